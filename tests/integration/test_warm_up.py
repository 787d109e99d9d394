"""Nothing is compiled, fetched from numba's cache, or imported of a library, once a run is under way: a motor would be energised meanwhile."""

import json
import subprocess
import sys

SCRIPT = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher
import commissioner.study.commissioning as study
from commissioner.study.specification import Case

def kernels():
    return {f"{d.py_func.__module__}.{d.py_func.__name__}": len(d.signatures) for d in gc.get_objects() if isinstance(d, Dispatcher)}

def libraries():
    return {name for name in sys.modules if name.partition(".")[0] in ("scipy", "pydantic")}  # numba's own are asked for by the simulator's kernels, too

begun, imported, in_memory = {}, set(), study._in_memory
study._in_memory = lambda *given: begun.update(kernels()) or imported.update(libraries()) or in_memory(*given)
row = study.commissioned(Case(0, 2, "commission", "abb_2k2", 0.0, (), None, "memory", (), (0.0,)))
late = [name for name, count in kernels().items() if name.startswith("commissioner.") and count > begun.get(name, 0)]
print(json.dumps([row["outcome"], late, sum(begun.values()), sorted(libraries() - imported)]))
"""


def test_every_kernel_of_a_run_is_there_before_it_begins():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, encoding="utf-8", check=True)
    outcome, late, known, imported = json.loads(done.stdout.splitlines()[-1])
    assert outcome == "commissioned"
    assert known > 10
    assert late == []
    assert imported == []
