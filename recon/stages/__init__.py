"""What the pipeline calls: each step of a build, counted and timed, with what it warns of."""
