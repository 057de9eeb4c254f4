"""What is announced reaches the innermost listener, once."""

from dynresp.support.progress import announce, hearing


def test_each_text_is_heard_once() -> None:
    outer: list[str] = []
    inner: list[str] = []
    announce("nobody listens")
    with hearing(outer.append):
        announce("a")
        with hearing(inner.append):
            announce("a")
            announce("a")
            announce("b")
        announce("a")
        announce("c")
    announce("nobody listens any more")
    assert outer == ["a", "c"]
    assert inner == ["a", "b"]
