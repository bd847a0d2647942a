"""What a user did wrong is one line on stderr, whole, and exit code 2."""

import pytest

from guidance.console import one_line_errors


@pytest.mark.parametrize("error", [ValueError, OSError])
def test_a_wrong_argument_is_one_line_and_exit_code_2(
    error: type[Exception], capsys: pytest.CaptureFixture[str]
) -> None:
    """However long the line is, and whatever rich would read as markup in it."""
    message = "path must not hold [red] words, got " + "a word " * 40
    with pytest.raises(SystemExit) as stopped, one_line_errors():
        raise error(message.strip())
    assert stopped.value.code == 2
    assert capsys.readouterr().err == f"error: {message.strip()}\n"


def test_a_fault_of_the_software_keeps_its_traceback() -> None:
    with pytest.raises(TypeError), one_line_errors():
        raise TypeError("fault")
