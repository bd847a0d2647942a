"""Flight code: the indirect method and its bound once more, as one C99 file without dependencies.

`powered_descent.c` and its header stand here as data of the package, with the program that checks a build of
them, a Makefile and a README. `reference` is what the C code must answer, by the kernels of Python; `vectors`
draws examples of it. `guidance.export_c` imports this wing, and writes all of it into a folder.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from guidance.flight_code.reference import CodeAnswer, CodeStatus, Question, answer_question
    from guidance.flight_code.vectors import draw_questions

_HOMES = {
    "guidance.flight_code.reference": (
        "CodeAnswer",
        "CodeStatus",
        "Question",
        "answer_question",
    ),
    "guidance.flight_code.vectors": ("draw_questions",),
}

__all__ = [
    "CodeAnswer",
    "CodeStatus",
    "Question",
    "answer_question",
    "draw_questions",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
