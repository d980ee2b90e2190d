"""What a user sees of a run: table, chart, page, files."""
