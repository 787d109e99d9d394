"""The extended model's trajectory and its derivatives, compiled. They are written into one another: a change in one concerns all."""

from commissioner.compiled import forget_stale_kernels

forget_stale_kernels(__path__[0], "kernels/kinds.py")
