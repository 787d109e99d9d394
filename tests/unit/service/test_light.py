"""What a service needs to begin: nothing that computes. Runs, checks and identifications are processes of their own."""

import subprocess
import sys

HEAVY = ("scipy", "numba", "matplotlib", "pandas")


def test_the_service_begins_without_what_computes():
    call = f"import sys, commissioner.service.serving; print([name for name in {HEAVY} if name in sys.modules])"
    said = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
