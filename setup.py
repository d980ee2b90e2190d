"""Everything is in pyproject.toml, except that setuptools takes cffi modules here only."""

import sys
from pathlib import Path

from setuptools import setup

# The builders import each other from the sources, which no build environment has installed.
sys.path.insert(0, str(Path(__file__).resolve().parent))

setup(
    cffi_modules=[
        f"tools/native_extensions.py:{name}"
        for name in ("firmware", "rivals", "native", "runner", "pack")
    ],
    # cffi builds against the stable ABI; one wheel serves every Python from 3.10 on.
    options={"bdist_wheel": {"py_limited_api": "cp310"}},
)
