"""Everything is in pyproject.toml, except that setuptools takes cffi modules here only."""

from setuptools import setup

setup(
    cffi_modules=[
        "bms/firmware/build.py:ffibuilder",
        "bms/rivals/build.py:ffibuilder",
        "hil_sim/campaign/build.py:ffibuilder",
    ]
)
