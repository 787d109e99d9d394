"""From the blocks of a run to one recording in the contract's format."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby, pairwise
from operator import itemgetter

import numpy as np

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.space_vector import axis_current_a
from commissioner.records import SampleBlock, Signal, StandstillRecording, peak


def assemble(
    blocks: Iterable[tuple[int, SampleBlock]], metadata: Mapping[str, float | str], source: str
) -> StandstillRecording | None:
    """The recording of (segment, block) pairs in order, or None where there is no sample.

    Segments follow each other on the time axis; lost samples are missing rows, as the contract says.
    """
    rows: list[tuple[int, SampleBlock]] = []
    begun_s: list[float] = []
    offset_s, end_s, current = 0.0, 0.0, None
    for segment, block in blocks:
        if block.count == 0:
            continue
        if segment != current:
            offset_s, current = end_s, segment
        begun_s.append(offset_s)
        last_s = offset_s + float(block.first_index + block.count - 1) * block.sample_period_s
        end_s = last_s + block.sample_period_s
        rows.append((segment, block))
    if not rows:
        return None
    counts = np.array([block.count for _, block in rows])
    before = np.array([block.first_index for _, block in rows]) - (np.cumsum(counts) - counts)
    index = np.arange(counts.sum()) + np.repeat(before, counts)
    periods_s = np.repeat([block.sample_period_s for _, block in rows], counts)
    averaged = np.repeat(np.array([block.averaged for _, block in rows], dtype=np.int64), counts)
    has_means, period_s = bool(np.any(averaged > 1)), rows[0][1].sample_period_s / rows[0][1].averaged
    third = [block.current_w_a for _, block in rows if block.current_w_a is not None]
    return StandstillRecording(
        time_s=np.repeat(begun_s, counts) + index * periods_s,
        segment=np.repeat(np.array([segment for segment, _ in rows], dtype=np.int64), counts),
        axis_deg=np.repeat([float(block.axis_deg) for _, block in rows], counts),
        voltage_axis_v=np.concatenate([block.voltage_axis_v for _, block in rows]),
        current_u_a=np.concatenate([block.current_u_a for _, block in rows]),
        current_v_a=np.concatenate([block.current_v_a for _, block in rows]),
        current_w_a=np.concatenate(third) if len(third) == len(rows) else None,
        dc_link_v=np.repeat([float(block.dc_link_v) for _, block in rows], counts),
        sample_period_s=period_s,
        metadata={**metadata, "sample_period_s": period_s} if has_means else metadata,
        source=source,
        averaged=averaged if has_means else None,
    )


def highest_stator_flux_wb(blocks: Iterable[tuple[int, SampleBlock]], machine: InverseGamma) -> float:
    """Over every energised sample of a run, ramps and first moments included, from the currents alone.

    Each segment begins without voltage: what its sensors show then is offset.
    """
    from commissioner.identify.excite.current_flux import CurrentFlux  # scipy: not for who only lists an archive

    highest = 0.0
    for _, of_segment in groupby(((s, b) for s, b in blocks if b.count), key=itemgetter(0)):
        parts = [block for _, block in of_segment]
        flux, offset_a = CurrentFlux(machine, parts[0].sample_period_s), float(np.mean(_along_axis(parts[:1])))
        holes = [k for k, block in enumerate(parts) if block.lost_before and k]
        for first, end in pairwise([0, *holes, len(parts)]):
            seen_a = _along_axis(parts[first:end]) - offset_a
            highest = max(highest, peak(flux.advance(seen_a, parts[first].lost_before)))
    return highest


def _along_axis(blocks: Sequence[SampleBlock]) -> Signal:
    """Of blocks along one axis, between which nothing is missing."""
    third = [block.current_w_a for block in blocks if block.current_w_a is not None]
    return axis_current_a(
        np.concatenate([block.current_u_a for block in blocks]),
        np.concatenate([block.current_v_a for block in blocks]),
        np.concatenate(third) if len(third) == len(blocks) else None,
        blocks[0].axis_deg,
    )


def columns(recording: StandstillRecording) -> dict[str, Signal]:
    """The recording as the contract's table."""
    table: dict[str, Signal] = {
        "time_s": recording.time_s,
        "segment": recording.segment.astype(np.float64),
        "axis_deg": recording.axis_deg,
        "voltage_axis_v": recording.voltage_axis_v,
        "current_u_a": recording.current_u_a,
        "current_v_a": recording.current_v_a,
    }
    if recording.current_w_a is not None:
        table["current_w_a"] = recording.current_w_a
    if recording.averaged is not None:
        table["averaged_periods"] = recording.averaged.astype(np.float64)
    if recording.dc_link_v is not None:
        table["dc_link_v"] = recording.dc_link_v
    return table
