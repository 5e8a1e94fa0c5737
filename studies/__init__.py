"""Studies beside the package: benchmarks on data of others, and checks of the tests themselves."""
