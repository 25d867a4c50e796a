"""Closed-class words of the rules understanding: what every word other than a noun does in an instruction.

The longest phrase wins; verbs stand in `verb_words`.
"""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from functools import cache

from gavel_agents.understanding.rules.verb_words import verb_phrases

__all__ = ["CHAT_STARTS", "Kind", "closed_words"]


class Kind(enum.Enum):
    """What a token does."""

    NOUN = "noun"
    ROOM = "room"
    VERB = "verb"  # value: what it asks for (`verb_words`)
    FACT = "fact"  # states where something is
    WISH = "wish"  # states where something shall be
    GOAL_MARK = "goal mark"  # what follows shall come true
    PREPOSITION = "preposition"  # value: on, in, to, from, out, off, through, with, under, beside
    RELATIVE = "relative"  # that's, which is
    PRONOUN = "pronoun"  # value: it, whole
    QUANTIFIER = "quantifier"  # both, all three
    COUNT = "count"  # more than one of a kind: refused
    DETERMINER = "determiner"
    AND = "and"
    COMMA = "comma"
    STOP = "stop"  # ; : dash
    THEN = "then"
    ALSO = "also"
    NOT = "not"
    THERE = "there"
    WHERE = "where"
    PARTICLE = "particle"
    ADJECTIVE = "adjective"  # value: what a wish for it asks for, or ""
    SWAPPED = "swapped"  # trade places, the other way round
    SAME = "same"  # do the same for
    CYCLE = "cycle"  # a wash, a spin, a cycle; value: WASH, DRY, TURN
    DOOR = "door"
    FILLER = "filler"
    UNKNOWN = "unknown"


_CHAT_STARTS = """
i i'm i've i'll i'd we we're we've we'll there there's here here's some a time today today's this it's my our guests
company just busy lots plenty things
"""
CHAT_STARTS = frozenset(_CHAT_STARTS.split())
"""A leading remark that names no thing, room or place and begins like this is small talk, not a request."""

_WISHERS = ("i", "we")
_WISHES = (
    "want|need|would like|would love|would prefer|could do with|could use|could go for|fancy|feel like|prefer|"
    "would appreciate|wish for|require|am after|are after|am in the mood for|are in the mood for|am looking for|"
    "are looking for|would be glad of|would be happy with|would be happier with|am going to need|are going to need|"
    "will need|will want|am craving|are craving|would rather have|would sooner have"
)
_SHORT = {"would": "'d", "am": "'m", "are": "'re", "will": "'ll"}

_PHRASES: Mapping[tuple[Kind, str], str] = {
    (Kind.FACT, ""): "is|are|was|were|there is|there are|there's|there're|you'll find|you will find|you can find|"
    "i left|i've left|i have left|we left|somebody left|someone left|somebody has left|someone has left|lies|sits|"
    "stands|lie|sit|i put|somebody put|someone put|is lying|are lying|is sitting|are sitting|is standing|"
    "are standing|"
    "has been left|have been left|was left|were left|got left|remains|remain|is kept|are kept|is currently|"
    "are currently|can be found|is located|are located|it's|they're",
    (Kind.WISH, ""): "might as well|would be better off|would be best|would be better|would look better|"
    "would look best|would look good|would do well|is best|are best|is best off|are best off|should|shall|must|"
    "needs|need to|needs to|has to|have to|had better|ought to|belongs|belong|goes|"
    "go|can go|may go|is meant to|are meant to|is supposed to|are supposed to|is to|are to|is wanted|are wanted|"
    "wants|"
    "want to|is needed|are needed|is required|are required|ends up|end up|gets|deserves|deserve|will go|is due|"
    "are due|"
    "is expected|are expected|wants to|is meant for|are meant for|will have to|has got to|have got to|"
    "is supposed to go|are supposed to go|lives|live|is going|are going|is asked for|come|comes",
    (Kind.GOAL_MARK, ""): "once|the right place for|the place for|the best place for|the proper place for|"
    "the right spot for|the best spot for|the spot for|the right home for|make sure|see that|see to it that|"
    "see to it|ensure|be sure|make certain|check that|"
    "verify that|make it so that|make it so|so that|it's time|i'd like it if|the aim is|the goal is|i'd like to see|"
    "i want to see|arrange for",
    (Kind.PREPOSITION, "on"): "on|onto|upon|on top of|on to|atop|over on|at the top of|to the top of|onto the top of",
    (Kind.PREPOSITION, "in"): "in|into|inside|within|inside of|in to|over in",
    (Kind.PREPOSITION, "to"): "to|over to|across to|back to|towards|toward|up to|down to",
    (Kind.PREPOSITION, "from"): "from|over from|away from",
    (Kind.PREPOSITION, "out"): "out of|from inside|from within|from in",
    (Kind.PREPOSITION, "off"): "off|off of|from on top of|from on|from the top of|from off",
    (Kind.PREPOSITION, "through"): "through",
    (Kind.PREPOSITION, "with"): "with|using|by means of",
    (Kind.PREPOSITION, "under"): "under|underneath|beneath|below",
    (Kind.PREPOSITION, "beside"): "next to|beside|near|by|close to|alongside",
    (Kind.PREPOSITION, "for"): "for",
    (Kind.PREPOSITION, "of"): "of|belonging to",
    (Kind.RELATIVE, ""): "that's|that is|that are|that was|that were|which is|which are|that's lying|that's sitting|"
    "lying|sitting|standing|located|that i left|that somebody left|that someone left|that we left|that's still|"
    "that's standing|that're|which was|"
    "that sits|"
    "that lies|that stands|that's kept|that has been left|resting|which lies|"
    "which sits|that is lying|that are lying|that is sitting|that are sitting|that you'll find",
    (
        Kind.PRONOUN,
        "it",
    ): "the machine|the appliance|it|them|they|these|those|this|that|everything|the lot|the pair|each|each one|one",
    (Kind.PRONOUN, "whole"): "the whole thing|the whole lot|the whole load|the loaded tray|the whole",
    (Kind.QUANTIFIER, "all"): "both|all|both of|all of|all three|all three of|the two|the three|all of the|both of the",
    (Kind.COUNT, ""): "two|three|four|five|six|seven|eight|nine|ten|every|several|many|few|dozen|twelve|each of|none",
    (Kind.DETERMINER, ""): "the|a|an|some|my|our|your|his|her|their|any|any of the|one of the|another",
    (Kind.AND, ""): "and|but|while|whereas|as well as|along with|together with|&|plus also|and likewise",
    (Kind.THEN, ""): "then|and then|afterwards|after that|next|finally|lastly|after which|when that's done|before|"
    "once that's done|after",
    (Kind.ALSO, ""): "and also|moving on|there is more|there's more|also|plus|besides|as well|in addition|"
    "additionally|"
    "too|furthermore|moreover|one more thing|"
    "one more job|"
    "while you're at it|on top of that|apart from that|what's more|likewise|oh|further|meanwhile|second|secondly|"
    "first|firstly|third|thirdly|another thing|another job|last but not least|one last thing|one other thing|"
    "beyond that|as an extra|that's not all",
    (Kind.NOT, ""): "don't|do not|never|not|without|no|isn't|aren't|shouldn't|avoid|nothing|nowhere|nor",
    (Kind.THERE, ""): "where it can stay|where they can stay|where it stays|where they stay|where it may stay|"
    "where they may stay|there|in there|on there|from there|in that one",
    (Kind.WHERE, ""): "where",
    (Kind.PARTICLE, ""): "away|up|down|back|together|over|around|along|aside|across|inwards",
    (Kind.PARTICLE, "on"): "going|powered|lit",
    (Kind.PARTICLE, "off"): "dark",
    (Kind.PARTICLE, "out"): "out",
    (Kind.ADJECTIVE, ""): "dirty|wet|damp|cold|big|small|little|large|old|new|unwashed|raw|uncooked|ready|waiting|"
    "missing|misplaced|stray|full|nice|used|soiled|whole|entire|still|instead|soaked|soaking|other",
    (Kind.ADJECTIVE, "HEAT"): "hot",
    (Kind.SWAPPED, ""): "trade places|trade spots|switch places|change places|swap places|the other way round|"
    "the other way around|swapped around|swap around|trade|swapped round|exchange places|swap spots|vice versa|"
    "change position|change positions|switch spots|switch around|in each other's place|reversed|round the other way",
    (
        Kind.SAME,
        "",
    ): "so does|so do|so is|so are|so should|so must|so has|so have|so will|do the same for|do the same with|"
    "the same for|the same with|the same goes for|same for|"
    "do likewise with|likewise for|repeat for|repeat with|repeat that for|repeat that with",
    (Kind.CYCLE, "WASH"): "a wash|a wash cycle|the wash|a clean|a rinse|a good wash|a proper wash|a washing",
    (Kind.CYCLE, "DRY"): "a dry|a drying cycle|a tumble|a tumble dry",
    (Kind.CYCLE, "TURN"): "a turn|a spin|a cycle|a run|a go|the cycle|a programme|a program|its cycle",
    (Kind.DOOR, ""): "door|doors|lid|drawer|the door|a door|its door|the doors|any door|the lid",
    (Kind.FILLER, ""): "until it is dry|until they are dry|until it's dry|until they're dry|until it is clean|"
    "until they are clean|until it's clean|until they're clean|until it is hot|until it's hot|"
    "the following needs doing|the following needs to be done|this needs doing|"
    "these need doing|these things need doing|"
    "take care of the following|see to the following|please do the following|not to forget|lest i forget|what else|"
    "what comes next|at some point|at some stage|at your leisure|at your convenience|next up|aside from that|"
    "would you care to|care to|do the following|the following|see if you can|see whether you can|"
    "the plan is to|the idea is to|the aim is to|the goal is to|one by one|one at a time|one after the other|"
    "one after another|separately|in turn|the places of|the positions of|the spots of|the whereabouts of|"
    "two things|all of these|all of the following|"
    "three things|these things|the following things|will you|won't you|try and|see about|"
    "go ahead|by itself|in any order|please|kindly|could you|can you|would you|will you|would you mind|do you mind|"
    "would you be so kind as to|would you be so good as to|be so kind as to|be so good as to|"
    "could you be so kind as to|"
    "if you would|how about|what about|"
    "you should|you can|you could|you may|you must|you need to|you have to|you ought to|don't forget to|"
    "do not forget "
    "to|remember to|i'd like you to|i would like you to|i want you to|i need you to|we need you to|we'd like you to|"
    "we want you to|it would be great if you could|it would be nice if you could|it'd be great if you could|"
    "it would be lovely if you could|i'd appreciate it if you could|i'd be glad if you could|i'd be grateful if you "
    "could|would it be possible to|is it possible to|would you please|could you please|can you please|"
    "will you please|"
    "go ahead and|go and|try to|feel free to|be a dear and|do me a favour and|do me a favor and|your task is to|"
    "your job is to|you're to|you are to|i ask you to|i'm asking you to|let's|make an effort to|may i ask you to|"
    "might you|i was hoping you could|i was hoping you would|i wonder if you could|could you possibly|"
    "here's what i need|here is what to do|here's what to do|here is what i need|here's the list|here is the list|"
    "a few things to do|there's some work for you|there is some work for you|some things to do|a couple of things|"
    "a few chores|a few jobs|a few errands|some chores|chores|errands|jobs|tasks|to do|to-do|todo|to do list|"
    "here's your list|here is your list|your list for today|today's list|today's chores|list for today|"
    "there's work to do|there is work to do|there are a few things to do|a few things|several things to do|"
    "i have a few jobs for you|i have some jobs for you|i've got a few jobs for you|i have a few things for you|"
    "time for some chores|these are your tasks|these are the tasks|these are your chores|"
    "hi|hello|hey|hi there|hello there|hey there|hey robot|hi robot|hello robot|robot|dear robot|ok robot|okay|ok|"
    "alright|all right|right|well|so|good morning|good evening|good afternoon|listen|thanks|thank you|thanks a lot|"
    "many thanks|cheers|thanks in advance|thank you very much|for me|for us|when you're done|when you are done|"
    "when you have a moment|when you've a moment|when you get a chance|when you can|when you have time|if you can|"
    "when it's done|when it is done|when they're done|when done|once done|when finished|once you're done|"
    "when you're finished|once it's done|once it is done|once they're done|when it's finished|when it is finished|"
    "if possible|if you please|if you don't mind|each time|every time|after each one|after each|after each item|"
    "just|now|today|right away|straight away|again|be|been|being|has been|there to stay|simply|"
    "the rest of|away safely|safely|carefully|gently|quickly|properly|neatly|actually|really|perhaps|maybe|"
    "somewhere|for now|at once|immediately|first of all|to begin with|to start with|to start|that|yet|"
    "to finish|to end with|i think|in the end|in that case|by the way|your|way|itself|themselves|exactly",
}


def _orders() -> Iterator[str]:
    """Yield `someone should`, `somebody has to`, ...: who is told is the robot in any case."""
    for who in ("someone", "somebody"):
        for must in ("should", "must", "has to", "needs to", "ought to", "had better", "could", "can", "will have to"):
            yield f"{who} {must}"


def _wishes() -> Iterator[str]:
    """Yield `i want`, `i'd like`, `we could do with to have`, ..."""
    for who in _WISHERS:
        for wish in _WISHES.split("|"):
            first, _, rest = wish.partition(" ")
            for said in (f"{who} {wish}", f"{who}{_SHORT[first]} {rest}" if first in _SHORT else ""):
                yield from (said, f"{said} to have") if said else ()


@cache
def closed_words() -> Mapping[tuple[str, ...], tuple[Kind, str]]:
    """Return every closed-class phrase, as its words, with what it does."""
    table: dict[tuple[str, ...], tuple[Kind, str]] = {}
    for phrase, meaning in verb_phrases():
        table[tuple(phrase.split())] = (Kind.VERB, meaning)
    for phrase in _orders():
        table[tuple(phrase.split())] = (Kind.FILLER, "")
    for phrase in _wishes():
        table[tuple(phrase.split())] = (Kind.VERB, "GET")
    for (kind, value), phrases in _PHRASES.items():
        for phrase in phrases.split("|"):
            table[tuple(phrase.split())] = (kind, value)
    return table
