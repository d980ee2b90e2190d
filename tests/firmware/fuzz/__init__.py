"""libFuzzer targets for the C core, each with an oracle, and their corpora."""
