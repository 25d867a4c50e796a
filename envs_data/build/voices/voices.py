"""The voices in which people speak, and the manners that a scenario may ask of its writer."""

from __future__ import annotations

from collections.abc import Mapping

from gavel_env.instructions.record import Instruction

__all__ = ["MANNERS", "VOICES", "manners_for"]

VOICES: Mapping[str, str] = {
    "curt": "as few words as possible; fragments are fine",
    "rambling": "thinks aloud, comes back to the point, mentions what does not matter",
    "elderly": "old-fashioned, courteous, explains a little too much",
    "child": "six to nine years old, simple words, excited or whining",
    "non-native": "English as a second language: articles and word order slip, the meaning stays clear",
    "transcript": "what speech recognition writes: lower case, no punctuation at all, a filler word or a false start",
    "list-maker": "writes lists (bullets, numbers, arrows, semicolons or headings; another form each time)",
    "polite": "very considerate; asks, never orders",
    "boss": "used to giving orders, expects results, may state results instead of actions",
    "texting": "chat message: abbreviations, lower case, maybe an emoji",
    "poetic": "likes images and rhythm; still says what is wanted",
    "technical": "engineer: precise, impersonal, states the end condition",
    "hurried-parent": "in a hurry, children around, interrupts themselves",
    "angry-caps": "ALL CAPITALS, annoyed",
    "story-first": "tells why before asking; the wish comes last or has to be drawn from the story",
    "typos": "types fast: one to three misspelt or swapped letters, still readable",
}
"""Name of a voice -> how that person speaks."""

MANNERS: Mapping[str, str] = {
    "omit-source": "say where a thing is now only if nobody could guess it",
    "time": "mention a time or an occasion",
    "owner": "say whose thing or whose room it is",
    "for-whom": "say for whom or what for",
    "state-the-end": "describe how things shall be, not what to do",
    "passive": "let things be done, without saying by whom",
    "no-verb": "leave out the verb somewhere",
    "aside": "put in an aside or a feeling",
    "wish": "speak of a wish or a bother instead of a command",
    "own-word": "use your own everyday word for the furniture and the rooms",
    "vague-piece": "name the place only as exactly as this house needs it",
    "one-sentence": "everything in one sentence",
    "several-sentences": "use several sentences, and pronouns for what was named before",
    "group-first": "name the things as a group first, then one by one",
    "doors": "say something about doors or machines being left as they should be",
    "again": "say how things were before or that this was asked before",
    "question": "make it a question",
}
"""Name of a manner -> what the writer is asked to do."""


def manners_for(record: Instruction) -> tuple[str, ...]:
    """Return the manners that can be asked for of a scenario."""
    several = len({literal.partition("(")[2] for task in record.tasks for literal in task.goal}) > 1
    return tuple(name for name in MANNERS if several or name not in ("group-first", "one-sentence"))
