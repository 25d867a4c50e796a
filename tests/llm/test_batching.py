"""Prompts of several threads in one call: who is asked together, what each gets back, and what happens on errors."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import pytest

from gavel_agents.llm import Completion, Message, Prompt
from gavel_agents.llm.batching import BatchingModel
from gavel_agents.llm.service import ModelError
from gavel_env.instructions.lookup import About

FOREVER_S = 600.0
"""A window that no test waits out: with it, only full batches are asked."""


class Counting:
    """Answers in capitals, notes what it was asked together, and refuses to be called twice at a time.

    Args:
        gate: what a call waits for before it answers.
        refuse: called with the texts of every call; may raise.
    """

    name = "counting"

    def __init__(
        self, gate: threading.Event | None = None, refuse: Callable[[list[str]], None] = lambda texts: None
    ) -> None:
        self.decoding = {"temperature": 0.0}
        self.calls: list[list[str]] = []
        self.called = threading.Event()
        self.overlapped = False
        self._gate = gate
        self._refuse = refuse
        self._alone = threading.Lock()

    def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
        if not self._alone.acquire(blocking=False):
            self.overlapped = True
            raise AssertionError("called twice at the same time")
        try:
            texts = [prompt.messages[-1].content for prompt in prompts]
            self.calls.append(texts)
            self.called.set()
            if self._gate is not None:
                assert self._gate.wait(60)
            self._refuse(texts)
            return [Completion(text.upper(), len(text), 1, 0.5) for text in texts]
        finally:
            self._alone.release()


class Asking(threading.Thread):
    """A thread that asks once, and keeps what it is given or what is raised."""

    def __init__(self, model: BatchingModel, *texts: str) -> None:
        super().__init__(daemon=True)
        self._model, self._texts = model, texts
        self.answers: list[str] = []
        self.error: BaseException | None = None
        self.start()

    def run(self) -> None:
        try:
            self.answers = [c.text for c in self._model.complete([prompt(text) for text in self._texts])]
        except BaseException as error:  # noqa: BLE001  looked at by the test
            self.error = error

    def done(self) -> Asking:
        self.join(60)
        assert not self.is_alive(), "the thread hangs"
        return self


def prompt(text: str) -> Prompt:
    return Prompt((Message("system", "plan"), Message("user", text)), About(text))


def failing_on(bad: str) -> Callable[[list[str]], None]:
    def refuse(texts: list[str]) -> None:
        if bad in texts:
            raise ModelError(f"{bad} is too long")

    return refuse


def test_prompts_of_several_threads_are_asked_in_one_call() -> None:
    inner = Counting()
    model = BatchingModel(inner, 4, FOREVER_S)
    asking = [Asking(model, text) for text in "abcd"]
    assert [one.done().answers for one in asking] == [["A"], ["B"], ["C"], ["D"]]
    assert [sorted(texts) for texts in inner.calls] == [["a", "b", "c", "d"]]


def test_what_is_asked_while_a_call_is_under_way_is_the_next_batch() -> None:
    gate = threading.Event()
    inner = Counting(gate)
    model = BatchingModel(inner, 3, FOREVER_S)
    first = Asking(model, "a", "b", "c")
    assert inner.called.wait(60)
    others = [Asking(model, text) for text in "xyz"]
    gate.set()
    assert first.done().answers == ["A", "B", "C"]
    assert [one.done().answers for one in others] == [["X"], ["Y"], ["Z"]]
    assert inner.calls[0] == ["a", "b", "c"]
    assert [sorted(texts) for texts in inner.calls[1:]] == [["x", "y", "z"]]


def test_one_who_asks_alone_is_answered_when_the_window_has_passed() -> None:
    inner = Counting()
    model = BatchingModel(inner, 8, 0.0)
    assert [c.text for c in model.complete([prompt("b"), prompt("a")])] == ["B", "A"]
    assert inner.calls == [["b", "a"]]


def test_a_call_is_never_split_and_an_empty_one_is_not_asked() -> None:
    inner = Counting()
    model = BatchingModel(inner, 2, FOREVER_S)
    assert len(model.complete([prompt(text) for text in "abcde"])) == 5
    assert model.complete([]) == []
    assert inner.calls == [list("abcde")]


def test_more_callers_than_a_batch_holds_are_all_answered() -> None:
    inner = Counting()
    model = BatchingModel(inner, 2, FOREVER_S)
    asking = [Asking(model, text) for text in "abcdef"]
    assert [one.done().answers for one in asking] == [[text.upper()] for text in "abcdef"]
    assert [len(texts) for texts in inner.calls] == [2, 2, 2]


def test_an_error_reaches_the_one_whose_prompt_it_is_about() -> None:
    inner = Counting(refuse=failing_on("b"))
    model = BatchingModel(inner, 3, FOREVER_S)
    asking = [Asking(model, text) for text in "abc"]
    good, bad, also_good = (one.done() for one in asking)
    assert (good.answers, also_good.answers) == (["A"], ["C"])
    assert isinstance(bad.error, ModelError)
    assert str(bad.error) == "b is too long"
    assert sorted(map(len, inner.calls)) == [1, 1, 1, 3]
    assert [c.text for c in model.complete([prompt(text) for text in "xyz"])] == ["X", "Y", "Z"]


def test_an_error_of_every_call_reaches_every_caller_as_its_own() -> None:
    def broken(texts: list[str]) -> None:
        raise RuntimeError(" ".join(texts))

    model = BatchingModel(Counting(refuse=broken), 2, FOREVER_S)
    one, other = Asking(model, "a"), Asking(model, "b")
    assert [str(one.done().error), str(other.done().error)] == ["a", "b"]


def test_too_few_answers_are_an_error_and_never_someone_elses() -> None:
    class Forgetful(Counting):
        def complete(self, prompts: Sequence[Prompt]) -> list[Completion]:
            return super().complete(prompts)[: len(prompts) - ("b" in [p.about.text for p in prompts])]

    model = BatchingModel(Forgetful(), 2, FOREVER_S)
    one, other = Asking(model, "a"), Asking(model, "b")
    assert one.done().answers == ["A"]
    with pytest.raises(ModelError, match="0 completions for 1 prompts"):
        raise other.done().error or AssertionError("no error")


def test_when_the_thread_that_asks_for_all_is_interrupted_the_others_are_asked_for_again() -> None:
    interrupted = threading.Event()

    def interrupt_once(_: list[str]) -> None:
        if not interrupted.is_set():
            interrupted.set()
            raise KeyboardInterrupt

    inner = Counting(refuse=interrupt_once)
    model = BatchingModel(inner, 2, FOREVER_S)
    pair = [Asking(model, "a"), Asking(model, "b")]
    assert interrupted.wait(60)
    later = Asking(model, "c")
    assert later.done().answers == ["C"]
    errors = [one.done().error for one in pair]
    assert sorted(map(type, errors), key=str) == sorted([KeyboardInterrupt, type(None)], key=str)
    assert [one.answers for one in pair if one.error is None] in ([["A"]], [["B"]])
    assert inner.calls[1] == [next(t for t, one in zip("ab", pair, strict=True) if one.error is None), "c"]


@pytest.mark.parametrize("window_s", [0.0, 0.001])
def test_everyone_gets_their_own_answers_in_their_own_order(window_s: float) -> None:
    inner = Counting(refuse=failing_on("t3-7-1"))
    model = BatchingModel(inner, 5, window_s)
    start = threading.Barrier(8)
    wrong: list[str] = []

    def ask_often(number: int) -> None:
        start.wait(60)
        for turn in range(25):
            texts = [f"t{number}-{turn}-{i}" for i in range(turn % 3)]
            try:
                answers = [c.text for c in model.complete([prompt(text) for text in texts])]
            except ModelError:
                answers = ["failed"] if "t3-7-1" not in texts else []
                texts = []
            if answers != [text.upper() for text in texts]:
                wrong.append(f"{texts} {answers}")

    threads = [threading.Thread(target=ask_often, args=(n,), daemon=True) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    assert not wrong
    assert not inner.overlapped
    asked = {text for texts in inner.calls for text in texts}
    assert asked == {f"t{n}-{t}-{i}" for n in range(8) for t in range(25) for i in range(t % 3)}


def test_name_and_decoding_are_the_models() -> None:
    inner = Counting()
    model = BatchingModel(inner, 2)
    assert (model.name, model.decoding) == ("counting", inner.decoding)
    with pytest.raises(ValueError, match="at least one prompt"):
        BatchingModel(inner, 0)
