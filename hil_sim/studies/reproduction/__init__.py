"""The paper's table and figures beside ours: runs, comparison, causes, files."""
