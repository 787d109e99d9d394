"""Imported once by the server that victims are forked from: kernels loaded, so that no victim waits for them."""

from commissioner.procedure.energised.excite import warm_up
from tests.campaigns.short_run.short_course import plate

warm_up(plate())
