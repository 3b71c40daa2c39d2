// Prefix sums within a workgroup of THREADS invocations (Hillis and Steele 1986, "Data Parallel Algorithms"). The importing
// shader declares THREADS.
var<workgroup> sums: array<u32, THREADS>;

// Returns the sum of `own` over the invocations up to and including this one, and leaves it in `sums`. Exact below 2^32. All
// invocations of the workgroup must call it.
fn prefix_sum(thread: u32, own: u32) -> u32 {
    sums[thread] = own;
    workgroupBarrier();
    for (var step = 1u; step < THREADS; step <<= 1u) {
        var before = 0u;
        if (thread >= step) {
            before = sums[thread - step];
        }
        workgroupBarrier();
        sums[thread] += before;
        workgroupBarrier();
    }
    return sums[thread];
}
