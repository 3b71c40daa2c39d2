"""Error and time: metrics, truth, the benchmark, its reports and plots."""
