"""Mutation testing of the safety core: `python -m tests.campaigns.mutants [--show] [--module NAME]`.

Every mutant of safety/, motor/plate_match.py and procedure/states.py must fail the safety core's own tests. Operators: comparisons moved by
one step or turned round, `and`/`or` exchanged, `not` dropped, numbers and booleans changed, min/max exchanged, a signed
value for its magnitude, a condition fixed to true or false, a table's target replaced, an `or` chain losing a member, an
answer lost.
Survivors are compared with EXPLAINED. Mutants are compiled in memory: nothing on the disk changes.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import importlib
import io
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[2]
TARGETS = {
    "commissioner.safety.applied": ("tests/unit/safety/test_applied.py",),
    "commissioner.safety.limits": ("tests/unit/safety/test_limits.py",),
    "commissioner.safety.watch": ("tests/unit/safety/test_watch.py",),
    "commissioner.safety.freshness": ("tests/unit/safety/test_freshness.py",),
    "commissioner.safety.sensors": ("tests/unit/safety/test_sensors.py",),
    "commissioner.motor.plate_match": (
        "tests/unit/motor/test_plate_match.py",
        "tests/unit/motor/test_plate_scale.py",
        "tests/unit/motor/test_joined_otherwise.py",
    ),
    "commissioner.procedure.states": ("tests/unit/procedure/test_states.py",),
}
"""commands.py holds records only: there is nothing to mutate."""
ROUNDED = "equality of two rounded numbers"
EXPLAINED = {
    (
        "commissioner.safety.freshness",
        "least_s * (1.0 - MOST_OFF) - allowed_s <= drive_s <",
    ): "rounded numbers would have to be equal",
    (
        "commissioner.safety.freshness",
        "least_s * (1.0 - MOST_OFF) - allowed_s < drive_s",
    ): "rounded numbers would have to be equal",
    (
        "commissioner.safety.freshness",
        "most_s / OTHER_TIME <",
    ): "rounded numbers would have to be equal",
    (
        "commissioner.safety.freshness",
        "began_after_s <= self._began_after_s(sent_s)",
    ): "the same age, told again by another answer",
    ("commissioner.safety.freshness", "made: int = 0"): "no drive has made fewer samples than none",
    (
        "commissioner.safety.watch",
        "-(block.current_u_a + block.current_v_a)",
    ): "the same: only the magnitude of the third phase is looked at",
    (
        "commissioner.safety.limits",
        '_within("sum of tone amplitudes", peak, 0.0, bounds.test_voltage_v)',
    ): "0.0 or -1.0 as the lower limit: a sum of magnitudes is below neither",
    (
        "commissioner.safety.limits",
        'return _within("bias", abs(command.bias_v), 0.0, bounds.test_voltage_v)',
    ): "0.0 or -1.0 as the lower limit: a magnitude is below neither",
    (
        "commissioner.safety.limits",
        "limits = zip(fields(circuit), circuit.as_tuple(), box.lower.as_tuple(),",
    ): "strict or not: four fields, four values, four limits",
    ("commissioner.safety.sensors", "+ floor_a -> abs(shown - claimed) <"): ROUNDED,
    ("commissioner.safety.sensors", "np.abs(cosines) > LEAST_SHARE -> np.abs(cosines) >= LEAST_SHARE"): ROUNDED,
    ("commissioner.safety.sensors", "size_a > noise_a -> size_a >= noise_a"): ROUNDED,
    ("commissioner.safety.sensors", "moved_v > MOVES * top_v -> moved_v >= MOVES * top_v"): ROUNDED,
    (
        "commissioner.safety.sensors",
        "-phases.sum(axis=0) -> phases.sum(axis=0)",
    ): "only the magnitude of the third phase is looked at",
    ("commissioner.safety.sensors", "self._gone_s < GONE_S"): ROUNDED,
    (
        "commissioner.safety.sensors",
        "float(np.max(rest)) > MISFIT * along_a + noise_a + step_a -> float(np.max(rest)) >= ",
    ): ROUNDED,
    (
        "commissioner.motor.plate_match",
        "wired_otherwise >= math.sqrt(OTHER_CONNECTION * HALVES) -> wired_otherwise > ",
    ): ROUNDED,
    ("commissioner.safety.sensors", "size_a > FLOWED * noise_a + self._step_a -> size_a >= "): ROUNDED,
    ("commissioner.safety.sensors", "size_a > SIGMAS * noise_a + self._step_a -> size_a >= "): ROUNDED,
    ("commissioner.safety.sensors", "volts_v >= AS_MUCH * drove_v -> volts_v > "): ROUNDED,
    ("commissioner.safety.sensors", "OPEN_SHARE * size_a + noise_a -> _rms(current.sum(axis=0)) >= "): ROUNDED,
    (
        "commissioner.safety.sensors",
        "_drove: tuple[float, int] = (0.0, 0)",
    ): "a volt squared beside those of many windows",
    ("commissioner.safety.sensors", "OPEN_SHARE * size_a + noise_a < asked_a -> carries_a <"): ROUNDED,
    ("commissioner.safety.sensors", "_gone_s: float = 0.0"): "the first window sets it",
    (
        "commissioner.safety.sensors",
        "QUIET = 3.0",
    ): "chosen with room: an open phase shows one deviation, a current many",
    ("commissioner.safety.sensors", "FLOWED, GONE_S = 60.0, 0.12"): "chosen with room: 60 deviations or 61",
    (
        "commissioner.motor.plate_match",
        "ratios = [a / b for a, b in zip(machine.as_tuple(), typical.as_tuple(), strict=True)]",
    ): "strict or not: four values, four values",
    ("commissioner.motor.plate_match", "> 0.27 -> abs(math.log(size / near[0])) >= 0.27"): ROUNDED,
    ("commissioner.motor.plate_match", "<= OTHER_CONNECTION * MOST_INDUCTIVE -> least <"): ROUNDED,
    (
        "commissioner.motor.plate_match",
        "<= factor * match.current_ratio <= CURRENT_RATIO[1] -> CURRENT_RATIO[0] <",
    ): ROUNDED,
    ("commissioner.motor.plate_match", "< ALIKE -> abs(math.log(current / factor)) <= ALIKE"): ROUNDED,
    ("commissioner.motor.plate_match", "> plate.rated_power_w -> abs(seen.power_w - said.power_w) >="): ROUNDED,
    ("commissioner.motor.plate_match", "said.power_w > seen.power_w -> said.power_w >="): "their signs differ",
    ("commissioner.motor.plate_match", "factor > 1.0 -> factor >= 1.0"): "no usual factor is near 1",
}
"""(module, part of the line with the mutant in it or of the mutant's name) of survivors, and why no test can kill them."""

COMPARISONS = {
    ast.Lt: (ast.LtE, ast.Gt), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.Lt), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}  # fmt: skip
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}
ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.BitOr: ast.BitAnd}


@dataclass(frozen=True)
class Mutant:
    module: str
    line: int
    before: str
    after: str
    tree: ast.Module
    text: str

    @property
    def is_explained(self) -> bool:
        return any(module == self.module and (part in self.text or part in self.name) for module, part in EXPLAINED)

    @property
    def name(self) -> str:
        return f"{self.module}:{self.line}: {self.before} -> {self.after}"


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """One tree for each single change."""
    tree, lines = ast.parse(source), ["", *source.splitlines()]
    for place, node in enumerate(ast.walk(tree)):
        for kind, changed in enumerate(_changes(node)):
            fresh = copy.deepcopy(tree)
            target = next(n for k, n in enumerate(ast.walk(fresh)) if k == place)
            replacement = list(_changes(target))[kind]
            fresh = ast.fix_missing_locations(_Swap(target, replacement).visit(fresh))
            line = getattr(node, "lineno", 0)
            yield Mutant(module, line, ast.unparse(node), ast.unparse(changed), fresh, lines[line])


class _Swap(ast.NodeTransformer):
    def __init__(self, target: ast.AST, replacement: ast.AST) -> None:
        self.target, self.replacement = target, replacement

    def visit(self, node: ast.AST) -> ast.AST:
        return self.replacement if node is self.target else self.generic_visit(node)


def _changes(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Compare(left=left, ops=ops, comparators=right):
            for k, op in enumerate(ops):
                for other in COMPARISONS[type(op)]:
                    yield ast.Compare(left, [*ops[:k], other(), *ops[k + 1 :]], right)
        case ast.BoolOp(op=op, values=values):
            yield ast.BoolOp(ast.And() if isinstance(op, ast.Or) else ast.Or(), values)
            for k in range(len(values)):
                rest = values[:k] + values[k + 1 :]
                yield ast.BoolOp(op, rest) if len(rest) > 1 else rest[0]
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.Constant(value=bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(value=int() | float() as value):
            yield ast.Constant(value + 1)
            yield ast.UnaryOp(ast.USub(), ast.Constant(1 - value)) if value < 1 else ast.Constant(value - 1)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=keywords) if name in CALLS:
            yield ast.Call(ast.Name(CALLS[name], ast.Load()), arguments, keywords)
        case ast.Call(func=ast.Name(id="abs"), args=[argument]):
            yield argument
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC and not _is_type(node):
            yield ast.BinOp(left, ARITHMETIC[type(op)](), right)
        case ast.If(body=body, orelse=otherwise):
            yield ast.If(ast.Constant(True), body, otherwise)
            yield ast.If(ast.Constant(False), body, otherwise)
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield ast.Return(ast.Constant(None))
        case ast.IfExp(body=body, orelse=otherwise):
            yield body
            yield otherwise
        case ast.keyword(arg=str(), value=ast.Name() | ast.Attribute() as value) if node.arg in FACTS:
            yield ast.keyword(node.arg, ast.Constant(None))
        case ast.Attribute(value=ast.Name(id="State"), attr=name) if name in STATES:
            yield ast.Attribute(ast.Name("State", ast.Load()), STATES[name], ast.Load())
        case ast.Attribute(value=ast.Name(id="Event"), attr=name) if name in EVENTS:
            yield ast.Attribute(ast.Name("Event", ast.Load()), EVENTS[name], ast.Load())


def _is_type(node: ast.BinOp) -> bool:
    """`X | None` or `float | str` of an annotation, which nothing evaluates."""
    if not isinstance(node.op, ast.BitOr):
        return False
    optional = isinstance(node.right, ast.Constant) and node.right.value is None
    return optional or (isinstance(node.left, ast.Name) and node.left.id in ANNOTATED)


ANNOTATED = frozenset({"float", "Refusal", "SetDriveLimits", "LoadExcitation", "StopReason"})
FACTS = frozenset({"watchdog_s", "drive_limits", "loaded"})
STATES = {
    "IDLE": "CHECKING", "CONNECTING": "RESISTANCE", "CHECKING": "RESISTANCE", "RESISTANCE": "EXCITING",
    "EXCITING": "JUDGING", "JUDGING": "WRITING", "WRITING": "COMMISSIONED", "COMMISSIONED": "REJECTED",
    "REJECTED": "COMMISSIONED", "ABORTED": "COMMISSIONED", "FAULTED": "COMMISSIONED",
}  # fmt: skip
EVENTS = {
    "START": "IDENTIFIED", "IDENTIFIED": "CHECKS_PASSED", "CHECKS_PASSED": "CHECK_FAILED", "CHECK_FAILED": "ABORT",
    "MEASURED_BEFORE": "CHECK_FAILED",
    "RESISTANCE_KNOWN": "AXIS_DONE", "AXIS_DONE": "AXES_DONE", "AXES_DONE": "AXIS_DONE", "WRITE_BACK": "KEEP",
    "KEEP": "WRITE_BACK", "REJECT": "KEEP", "VERIFIED": "REJECT", "ABORT": "FAULT", "FAULT": "ABORT",
}  # fmt: skip


def survives(mutant: Mutant) -> bool:
    """Whether the tests pass on it; in a child of this process, so that nothing of it is left."""
    child = os.fork()
    if child == 0:
        os._exit(_tests_pass(mutant))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1


def _tests_pass(mutant: Mutant) -> int:
    import pytest

    module = importlib.import_module(mutant.module)
    try:
        exec(compile(mutant.tree, str(module.__file__), "exec"), _emptied(module).__dict__)
    except Exception:
        return 0
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        files = [str(ROOT / name) for name in TARGETS[mutant.module]]
        return int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:hypothesispytest", *files]) == 0)


def _emptied(module: ModuleType) -> ModuleType:
    kept = {name: value for name, value in vars(module).items() if name.startswith("__")}
    vars(module).clear()
    vars(module).update(kept)
    return module


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.mutants", description=__doc__)
    parser.add_argument("--show", action="store_true", help="name every mutant")
    parser.add_argument("--module", action="append", choices=list(TARGETS), help="only this one; repeatable")
    options = parser.parse_args(arguments)
    count, alive = 0, []
    for module in options.module or TARGETS:
        source = Path(str(importlib.import_module(module).__file__)).read_text("utf-8")
        for mutant in mutants(module, source):
            count += 1
            has_survived = survives(mutant)
            if options.show or (has_survived and not mutant.is_explained):
                print(f"{'SURVIVED' if has_survived else 'killed  '} {mutant.name}", flush=True)
            if has_survived:
                alive.append(mutant)
    unexplained = [mutant for mutant in alive if not mutant.is_explained]
    print(
        f"{count} mutants, {count - len(alive)} killed, {len(alive)} survived, {len(unexplained)} of them unexplained"
    )
    return int(bool(unexplained))


if __name__ == "__main__":
    sys.exit(main())
