"""Tables of the timing study: a line per method, and every call."""

from __future__ import annotations

from studies.columns import Column, Output
from studies.timing.answer_times import QUANTILES, AnswerTime
from studies.timing.measures import Call, Summary

_MS = 1e3  # s -> ms
_G = 1e3  # kg -> g


def _of_all(count: int, cases: int) -> str:
    return f"{count}/{cases}"


_SHOWN = Output.ALL & ~Output.FILE

SUMMARY_COLUMNS: tuple[Column[Summary], ...] = (
    Column("label", "method, time, nodes", lambda s: s.method, words=True, outputs=_SHOWN),
    Column("method", "method", lambda s: s.method.rsplit(", ", 2)[0], outputs=Output.FILE),
    Column("time", "time", lambda s: s.method.rsplit(", ", 2)[1], outputs=Output.FILE),
    Column("nodes", "nodes", lambda s: s.method.rsplit(", ", 2)[2], outputs=Output.FILE),
    Column("feasible_calls", "feasible", lambda s: s.feasible, outputs=Output.FILE),
    Column("solved", "solved", lambda s: s.solved, outputs=Output.FILE),
    Column("solved_of", "solved", lambda s: _of_all(s.solved, s.feasible), outputs=_SHOWN),
    Column("limits_broken", "limits broken", lambda s: s.broken),
    Column("infeasible_calls", "infeasible", lambda s: s.infeasible, outputs=Output.FILE),
    Column("refused", "refused", lambda s: s.refused, outputs=Output.FILE),
    Column("refused_of", "refused", lambda s: _of_all(s.refused, s.infeasible), outputs=_SHOWN),
    Column("cpu_ms_p50", "processor", lambda s: _MS * s.processor[0], digits=1, unit="ms"),
    Column("cpu_ms_p99", "99 %", lambda s: _MS * s.processor[1], digits=1, unit="ms"),
    Column("cpu_ms_max", "max", lambda s: _MS * s.processor[2], digits=1, unit="ms"),
    Column("wall_ms_p50", "wall", lambda s: _MS * s.wall, digits=1, unit="ms"),
    Column("regret_g_median", "regret", lambda s: _G * s.regret[0], digits=1, unit="g"),
    Column("regret_g_max", "max", lambda s: _G * s.regret[1], digits=1, unit="g"),
    Column("solves_mean", "solves", lambda s: s.solves, digits=1),
)
"""The methods: timing.csv, timing.md and the console read this list."""


def _quantile_column(number: int) -> Column[AnswerTime]:
    percent = f"{100.0 * QUANTILES[number]:g}"
    key = f"cpu_ms_p{percent.replace('.', '_')}"
    return Column(key, f"{percent} %", lambda row: _MS * row.quantiles[number], digits=2, unit="ms")


ANSWER_COLUMNS: tuple[Column[AnswerTime], ...] = (
    Column("starts", "starts", lambda row: row.starts, words=True),
    Column("answer", "answer", lambda row: row.answer, words=True),
    Column("count", "count", lambda row: row.count),
    *(_quantile_column(number) for number in range(len(QUANTILES))),
    Column("cpu_ms_max", "max", lambda row: _MS * row.greatest, digits=2, unit="ms"),
)
"""How long answers take: answers.csv, answers.md and the console read this list."""

CALL_COLUMNS: tuple[Column[Call], ...] = (
    Column("method", "method", lambda call: call.method),
    Column("case", "case", lambda call: call.case),
    Column("status", "status", lambda call: call.status.value),
    Column("cpu_ms", "processor", lambda call: _MS * call.processor),
    Column("wall_ms", "wall", lambda call: _MS * call.seconds),
    Column("regret_g", "regret", lambda call: _G * call.regret),
    Column("solves", "solves", lambda call: call.solves),
    Column("keeps_limits", "keeps limits", lambda call: call.keeps_limits),
    Column("miss_m", "miss", lambda call: call.miss),
)
"""Every call, as calls.csv has it."""
