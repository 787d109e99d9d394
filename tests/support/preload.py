"""What the server of `preloaded` has imported before it forks: all that a verb or the simulator imports late."""

import pkgutil
from importlib import import_module

import commissioner.cli.verbs

for module in pkgutil.walk_packages(commissioner.cli.verbs.__path__, "commissioner.cli.verbs."):
    import_module(module.name)
