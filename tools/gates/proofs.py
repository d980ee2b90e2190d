"""Proofs of the C core by CBMC: every harness of tests/firmware/proofs, for all inputs it grants.

    python -m tools.gates.proofs [NAME...]

CBMC looks at each claim of a harness, and in all code that it reaches at pointers, array bounds,
overflow, shifts, division and unwinding, and where the plan asks for it at conversions. Each proof
is made once more with something broken on purpose, which must fail. It prints what was proved.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
HARNESSES = ROOT / "tests" / "firmware" / "proofs"
CHECKS = (
    *("--bounds-check", "--pointer-check", "--signed-overflow-check"),
    *("--undefined-shift-check", "--div-by-zero-check", "--unwinding-assertions"),
)
LONGEST_S = 600


def prove(name: str, plan: Mapping[str, Any], changed: Path | None = None) -> list[dict[str, Any]]:
    """Every property that CBMC looked at, with its status; RuntimeError when it cannot.

    `changed` is a folder with a source that stands for the one of its name.
    """
    core = ROOT / "firmware_c"
    files = [HARNESSES / f"{name}.c", *(core / source for source in plan["sources"])]
    includes = [core / folder for folder in ("include", "src", "generated", "image", "port")]
    if changed is not None:
        there = {path.name: path for path in changed.iterdir()}
        files = [there.get(path.name, path) for path in files[1:]]
        files = [HARNESSES / f"{name}.c", *files]
        includes.insert(0, changed)
    command = [str(ROOT / "tools" / "cbmc.sh"), "--json-ui", *CHECKS]
    command += ["--unwind", str(plan["unwind"]), *plan.get("options", [])]
    command += [f"-I{path}" for path in [HARNESSES, *includes]] + list(map(str, files))
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST_S)
    for entry in json.loads(done.stdout or "[]"):
        if "result" in entry:
            found: list[dict[str, Any]] = entry["result"]
            return found
    raise RuntimeError(f"{name}: CBMC says nothing: {done.stdout[-2000:]}{done.stderr[-500:]}")


def broken_claims(name: str, plan: Mapping[str, Any]) -> int:
    """How many claims fail with the change that the plan makes in a source."""
    source, old, new = plan["broken"]
    (path,) = (ROOT / "firmware_c").rglob(source)
    text = path.read_text(encoding="utf-8")
    if old not in text:
        raise RuntimeError(f"{name}: '{old}' is not in {source} any more; bring it up to date")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / source).write_text(text.replace(old, new), encoding="utf-8")
        return sum(p["status"] == "FAILURE" for p in prove(name, plan, Path(folder)))


def main() -> int:
    """Prove all harnesses, or those named; 1 when a claim does not hold."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    plan = tomllib.loads((HARNESSES / "proofs.toml").read_text(encoding="utf-8"))
    failed, proved = False, {}
    for name, entry in plan.items():
        if arguments.names and name not in arguments.names:
            continue
        start_s = time.monotonic()
        found = prove(name, entry)
        wrong = [p for p in found if p["status"] != "SUCCESS"]
        for p in wrong:
            place = p.get("sourceLocation", {})
            where = f"{place.get('file', '')}:{place.get('line', '')}"
            print(f"{name}: {where}: {p['description']}: {p['status']}", file=sys.stderr)
        noticed = broken_claims(name, entry)
        if not noticed:
            print(f"{name}: nothing fails with what is broken on purpose", file=sys.stderr)
        failed = failed or bool(wrong) or not noticed
        proved[name] = len(found)
        took = f"{time.monotonic() - start_s:.1f} s"
        print(f"{name}: {len(found) - len(wrong)} of {len(found)}, {took}", file=sys.stderr)
    print(json.dumps({"properties": proved, "all": sum(proved.values())}, indent=1))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
