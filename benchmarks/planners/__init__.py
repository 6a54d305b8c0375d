"""Other programs' ways to plan the turn that `benchmarks.plan_peers` puts before all of them."""
