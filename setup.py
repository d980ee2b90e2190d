"""Everything is in pyproject.toml, except what setuptools takes here only: cffi modules, page."""

import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

# The builders import each other from the sources, which no build environment has installed.
sys.path.insert(0, str(Path(__file__).resolve().parent))


class BuildWithPage(build_py):
    """A wheel has the page of `bms dashboard` where the tools that make it are there."""

    def run(self) -> None:
        """Make the page first; a checkout that is installed in place makes it by `make page`."""
        if not self.editable_mode:
            from hil_sim.dashboard.build import InputError, build_if_needed  # noqa: PLC0415

            try:
                build_if_needed()
            except InputError as error:
                print(f"without the page of 'bms dashboard': {error}", file=sys.stderr)
        super().run()


setup(
    cmdclass={"build_py": BuildWithPage},
    cffi_modules=[
        f"tools/native_extensions.py:{name}"
        for name in ("firmware", "rivals", "native", "runner", "pack")
    ],
    # cffi builds against the stable ABI; one wheel serves every Python from 3.10 on.
    options={"bdist_wheel": {"py_limited_api": "cp310"}},
)
