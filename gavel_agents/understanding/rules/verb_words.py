"""The verbs of the rules understanding, grouped by what they ask for; their forms are derived."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache

__all__ = ["verb_forms", "verb_phrases"]

# What the verb asks for -> its verbs. MOVE: bring somewhere. GET: take up, or have somewhere. RUN: switch on.
_VERBS: Mapping[str, str] = {
    "MOVE": "put place set lay carry bring take move deliver transfer leave drop stick stow store keep stash return "
    "tidy pop stand relocate remove send rest hang position deposit shift haul pack tuck slide throw toss dump shelve "
    "serve stack load gather collect clear empty transport convey hand stay park ferry unload restock insert replace "
    "scoot wait dish nest perch arrange line house file bin hide",
    "GET": "get fetch grab find locate retrieve have want need seek pick lift pull",
    "FILL": "fill",
    "HEAT": "cook heat warm bake roast reheat fry grill toast broil microwave preheat boil simmer prepare",
    "WASH": "wash clean rinse launder scrub",
    "DRY": "dry tumble-dry",
    "FREEZE": "freeze",
    "RUN": "run start activate power flip light turn",
    "SWITCH": "switch",
    "OPEN": "open",
    "CLOSE": "close shut",
    "SWAP": "swap exchange interchange",
    "USE": "use",
    "LET": "let make",
    "GIVE": "give",
    "DO": "do",
}

_IRREGULAR: Mapping[str, tuple[str, ...]] = {
    "put": ("putting",),
    "set": ("setting",),
    "lay": ("laid", "laying"),
    "bring": ("brought",),
    "take": ("took", "taken"),
    "leave": ("left",),
    "stick": ("stuck",),
    "keep": ("kept",),
    "stand": ("stood",),
    "send": ("sent",),
    "hang": ("hung",),
    "throw": ("threw", "thrown"),
    "get": ("got", "gotten", "getting"),
    "find": ("found",),
    "have": ("had", "has"),
    "seek": ("sought",),
    "run": ("running", "ran"),
    "give": ("gave", "given"),
    "shut": ("shutting",),
    "let": ("letting",),
    "make": ("made",),
    "light": ("lit",),
    "freeze": ("froze", "frozen"),
    "slide": ("slid",),
    "fry": ("fried",),
    "tidy": ("tidied",),
    "dry": ("dried",),
    "tumble-dry": ("tumble-dried",),
    "carry": ("carried",),
    "ferry": ("ferried",),
}

_DOUBLING = frozenset({"bin", "drop", "flip", "grab", "pop", "scrub", "swap", "transfer"})

_PHRASE_VERBS: Mapping[str, str] = {
    "MOVE": "find a place for|find a spot for|find a home for|find room for|make room for|make space for|"
    "find space for|find somewhere for|put away|throw away|throw out|clear away|tidy up|tidy away|clear up|"
    "find a good place for|find a good spot for|drop off|set down|put down|put back|leave behind|hang up",
    "GET": "what i need is|what we need is|what i want is|what we want is|what i'd like is|the plan is to have|"
    "the idea is to have|the aim is to have|the goal is to have|round up|pick up|track down|hunt down|look for|"
    "search for|dig out|let me have|let us have|it would be nice to have|"
    "it'd be nice to have|it would be good to have|it would be great to have|it would be lovely to have|go get|"
    "go and get|go fetch|take hold of|get hold of|lay hands on|fish out|can i have|could i have|may i have|"
    "can we have|could we have|could do with|how nice it would be to have|i wish i had",
    "HEAT": "heat up|warm up|warm through|heat through",
    "DRY": "tumble dry|dry off|dry out",
    "WASH": "wash up|clean up",
    "RUN": "power up|fire up|boot up|start up|crank up|switch on|turn on|power on",
    "SWAP": "trade",
}


@cache
def verb_forms(verb: str) -> tuple[str, ...]:
    """Return a verb's forms: base, third person, past and -ing."""
    stem = verb + verb[-1] if verb in _DOUBLING else verb
    dropped = verb[:-1] if verb.endswith("e") else stem
    sibilant = verb.endswith(("s", "sh", "ch", "x", "z"))
    third, past = verb + ("es" if sibilant else "s"), dropped + "ed"
    if verb.endswith("y") and verb[-2] not in "aeiou":
        third, past = verb[:-1] + "ies", verb[:-1] + "ied"
    return tuple(dict.fromkeys((verb, third, past, dropped + "ing", *_IRREGULAR.get(verb, ()))))


def verb_phrases() -> Iterator[tuple[str, str]]:
    """Yield every verb in every form, with what it asks for."""
    for meaning, verbs in _VERBS.items():
        for verb in verbs.split():
            for form in verb_forms(verb):
                yield form, meaning
    for meaning, phrases in _PHRASE_VERBS.items():
        for phrase in phrases.split("|"):
            first, _, rest = phrase.partition(" ")
            forms = verb_forms(first) if " " in phrase and "'" not in first and len(first) > 2 else (first,)
            for form in forms:
                yield f"{form} {rest}".strip(), meaning
