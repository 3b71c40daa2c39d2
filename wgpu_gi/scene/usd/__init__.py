"""Loads OpenUSD stages (.usd .usda .usdc .usdz) with the package usd-core."""
