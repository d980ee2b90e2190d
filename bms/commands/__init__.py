"""Subcommands of `bms` that belong to battery engineering; one module each."""
