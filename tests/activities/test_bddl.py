"""BDDL problems: read into their parts, and what is wrong with one is said."""

from __future__ import annotations

import pytest

from gavel_env.activities.bddl import Node, parse_problem, predicates, synset_of
from gavel_env.errors import MalformedGoal

PROBLEM = """
(define (problem tidying_up-0)
    (:domain omnigibson) ; a comment with a ( in it
    (:objects
        apple.n.01_1 apple.n.01_2 - apple.n.01
        table.n.02_1 table.n.02_* - table.n.02
        floor.n.01_1 - floor.n.01
    )
    (:init
        (ontop apple.n.01_1 floor.n.01_1)
        (not (cooked ?apple.n.01_2))
        (inroom table.n.02_1 kitchen)
    )
    (:goal
        (and
            (forall (?apple.n.01 - apple.n.01) (ontop ?apple.n.01 ?table.n.02_1))
            (forn (1) (?apple.n.01 - apple.n.01) (not (cooked ?apple.n.01)))
        )
    )
)
"""


def test_a_problem_is_read_into_its_parts() -> None:
    problem = parse_problem(PROBLEM)
    assert problem.name == "tidying_up"
    assert problem.objects["table.n.02"] == ("table.n.02_1", "table.n.02_*")
    assert [str(fact) for fact in problem.init[:2]] == [
        "(ontop apple.n.01_1 floor.n.01_1)",
        "(not (cooked apple.n.01_2))",
    ]
    every, counted = problem.goal.parts
    assert every.variables == (("apple.n.01", "apple.n.01"),)
    assert counted.count == 1
    assert every.parts[0] == Node("ontop", ("apple.n.01", "table.n.02_1"))
    assert set(predicates(problem.goal)) == {("ontop", False), ("cooked", True)}
    assert parse_problem(str(problem)) == problem


def test_names_of_objects_lead_to_their_synsets() -> None:
    assert [synset_of(name) for name in ("apple.n.01_12", "cabinet.n.01_*", "apple.n.01")] == [
        "apple.n.01",
        "cabinet.n.01",
        "apple.n.01",
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("(:goal", "(:gaol"), "no section (:goal"),
        (("(not (cooked ?apple.n.01_2))", "(not (cooked ?pear.n.01_2))"), "'pear.n.01_2'"),
        (("(forn (1)", "(forn (one)"), "whole number"),
        (("(?apple.n.01 - apple.n.01) (ontop", "(?apple.n.01 apple.n.01) (ontop"), "(?x - synset)"),
        (("- floor.n.01\n", "\n"), "gives no synset for floor.n.01_1"),
        (("(inroom table.n.02_1 kitchen)", "(inroom table.n.02_1 kitchen"), "not closed"),
        (("(define", "(more) (define"), "2 expressions where one"),
        (("(:domain omnigibson)", "(:domain omnigibson)) ))"), "never opened"),
    ],
)
def test_what_is_wrong_with_a_problem_is_said(change: tuple[str, str], said: str) -> None:
    with pytest.raises(MalformedGoal) as caught:
        parse_problem(PROBLEM.replace(*change, 1), "here")
    assert said in str(caught.value)
    assert str(caught.value).startswith("here: ")
