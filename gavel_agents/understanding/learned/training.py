"""Training of the learned reader, with torch: `python -m gavel_agents.understanding.learned.train`."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy

import numpy as np
import torch
from torch import Tensor, nn

from gavel_agents.understanding.learned.encoder import Array, input_of
from gavel_agents.understanding.learned.minilm import Encoder
from gavel_agents.understanding.learned.network import OF_MENTION, OF_PAIR
from gavel_agents.understanding.learned.options import (
    MOST_KINDS,
    NO_ROOM,
    UNNAMED_ROOMS,
    WISHES,
    kinds_for,
    places_for,
    rooms_for,
    wishes_for,
)
from gavel_agents.understanding.learned.pieces import SIGNS, UNKNOWN, Pieces
from gavel_agents.understanding.learned.spotted import FEATURES, PAIR_FEATURES, Spotted, pair_features
from gavel_agents.understanding.learned.targets import Choice, Example, Wish

__all__ = ["Network", "fit", "joined", "values_of"]

_NOTHING = -1e4
_PAIR = 128
_SEEN = 3
"""How often the examples must have what a token does, for a row of its own."""
_OF_HEADS = 10.0
"""How many times as much the heads learn as the encoder."""


class Network(nn.Module):  # type: ignore[misc]
    """The network of `network.scores`, with gradients."""

    def __init__(self, encoder: Encoder, values: int, dropout: float) -> None:
        super().__init__()
        width = encoder.width
        self.encoder = encoder
        self.feature = nn.Linear(FEATURES, width, bias=False)
        self.value = nn.Embedding(values, width)
        for entered in (self.feature, self.value):
            nn.init.normal_(entered.weight, std=0.02)
        self.first = nn.Linear(width, _PAIR)
        self.second = nn.Linear(width, _PAIR, bias=False)
        self.beside = nn.Linear(PAIR_FEATURES, _PAIR, bias=False)
        self.pair = nn.Linear(_PAIR, len(OF_PAIR))
        self.own = nn.Linear(width, _PAIR)
        self.heads = nn.Linear(_PAIR, sum(OF_MENTION.values()))
        self.whole = nn.Linear(width, 1)
        self.drop = nn.Dropout(dropout)

    def forward(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor], Tensor]:
        """Return the scores of pairs (texts, mentions, mentions, 5), of mentions by head, and of texts as a whole."""
        told = self.feature(batch.features) + self.value(batch.values)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=self.training):
            x = self.encoder(batch.pieces, batch.present, batch.starts, told * batch.tokens.unsqueeze(-1))
        x = x.float()
        h = self.drop(_at(_at(x, batch.starts), batch.mentions))
        hidden = torch.relu(self.first(h)[:, :, None] + self.second(h)[:, None] + self.beside(batch.beside))
        heads = self.heads(self.drop(torch.relu(self.own(h)))).split(list(OF_MENTION.values()), -1)
        whole = self.whole(self.drop(x[:, 0])).squeeze(-1)
        return self.pair(self.drop(hidden)), dict(zip(OF_MENTION, heads, strict=True)), whole

    def tensors(self) -> dict[str, Array]:
        """Return the weights as `network.scores` takes them."""
        found: dict[str, Tensor] = {"value": self.value.weight}
        for name, part in self.named_children():
            if isinstance(part, nn.Linear):
                found[name] = part.weight.T
                if part.bias is not None:
                    found[f"{name}.bias"] = part.bias
        own = {name: np.ascontiguousarray(t.detach().numpy(), dtype=np.float32) for name, t in found.items()}
        return self.encoder.tensors() | own


def _at(x: Tensor, places: Tensor) -> Tensor:
    """Return the states at some places of each text."""
    return torch.gather(x, 1, places.unsqueeze(-1).expand(-1, -1, x.shape[-1]))


def values_of(examples: Sequence[Example]) -> dict[str, int]:
    """Return the numbers of what closed-class tokens do; 0 = none, or one that was hardly ever seen."""
    seen = Counter(v for e in examples for v in e.read.values if v)
    return {v: i + 1 for i, v in enumerate(sorted(v for v, times in seen.items() if times >= _SEEN))}


class Prepared:
    """An example as arrays; of one that cannot be said with its mentions only that is learnt."""

    def __init__(
        self, example: Example, pieces: Pieces, values: Mapping[str, int], hidden: Collection[int] = ()
    ) -> None:
        read = example.read
        self.whole = example.whole and not hidden
        self.example = example if self.whole else example._replace(items=(), wishes=())
        example = self.example
        self.given = input_of(read, pieces, values, hidden)
        self.hidden = hidden
        self.beside = pair_features(read).astype(bool)
        self.mentions = np.array([m.token for m in read.mentions], dtype=np.int64)
        count = len(read.mentions)
        self.own = np.zeros((len(example.items), count), dtype=bool)
        self.places = np.zeros((len(example.items), count, 2), dtype=bool)
        for row, item in enumerate(example.items):
            self.own[row, list(item.group.mentions)] = True
            for place, inside in places_for(read, item.group):
                self.places[row, place, inside] = True
        self.rooms = [[room for room, _ in rooms_for(read, mention)] for mention in read.mentions]
        self.kinds = np.zeros((count, MOST_KINDS), dtype=bool)
        self.wishes = np.zeros((count, len(WISHES)), dtype=bool)
        for index, mention in enumerate(read.mentions):
            self.kinds[index, : len(kinds_for(mention))] = True
            self.wishes[index, list(wishes_for(mention))] = True

    def unnamed(self, rng: random.Random, pieces: Pieces, values: Mapping[str, int]) -> Prepared:
        """Return the example with some of its things called `thing`, so that what is learnt holds for other things."""
        share = rng.random()
        read = self.example.read
        chosen = [m.token for m in read.mentions if m.movable and m.token not in self.hidden and rng.random() < share]
        drawn = copy(self)
        drawn.given = input_of(read, pieces, values, self.hidden, chosen)
        return drawn


class Batch:
    """Several examples, padded."""

    def __init__(self, prepared: Sequence[Prepared], rng: random.Random, unknown: float) -> None:
        length = max(len(p.given.starts) for p in prepared)
        longest = max(len(p.given.pieces) for p in prepared)
        count = max(*(len(p.mentions) for p in prepared), 1)
        size = len(prepared)
        features = np.zeros((size, length, FEATURES), dtype=np.float32)
        values, starts = np.zeros((2, size, length), dtype=np.int64)
        tokens = np.zeros((size, length), dtype=np.float32)
        pieces, present = np.zeros((2, size, longest), dtype=np.int64)
        mentions = np.zeros((size, count), dtype=np.int64)
        beside = np.zeros((size, count, count, PAIR_FEATURES), dtype=np.float32)
        rooms = np.zeros((size, count, count + len(UNNAMED_ROOMS) + 1), dtype=bool)
        kinds = np.zeros((size, count, MOST_KINDS), dtype=bool)
        rooms[:, :, NO_ROOM] = True
        wishes = np.zeros((size, count, len(WISHES)), dtype=bool)
        kinds[:, :, 0] = wishes[:, :, 0] = True
        for row, p in enumerate(prepared):
            n, m, given = len(p.given.starts), len(p.mentions), p.given
            features[row, :n], values[row, :n], starts[row, :n] = given.features, given.values, given.starts
            pieces[row, : len(given.pieces)], present[row, : len(given.pieces)] = given.pieces, 1
            tokens[row, :n], mentions[row, :m] = 1, p.mentions
            beside[row, :m, :m] = p.beside
            for mention, possible in enumerate(p.rooms):
                rooms[row, mention, possible] = True
            kinds[row, :m], wishes[row, :m] = p.kinds, p.wishes
        noise = np.random.default_rng(rng.randrange(2**32))
        pieces[(noise.random(pieces.shape) < unknown) & (pieces >= len(SIGNS))] = SIGNS.index(UNKNOWN)
        self.features, self.values, self.mentions = map(torch.from_numpy, (features, values, mentions))
        self.pieces, self.present, self.starts, self.tokens = map(torch.from_numpy, (pieces, present, starts, tokens))
        self.whole = torch.tensor([float(p.whole) for p in prepared])
        self.beside, self.rooms, self.kinds, self.wishes = map(torch.from_numpy, (beside, rooms, kinds, wishes))
        items = [(row, i) for row, p in enumerate(prepared) for i in range(len(p.example.items))]
        self.item_rows = torch.tensor([row for row, _ in items], dtype=torch.long)
        said = [prepared[row].example.items[i] for row, i in items]
        self.own = torch.zeros(len(items), count, dtype=torch.bool)
        self.places = torch.zeros(len(items), count, 2, dtype=torch.bool)
        self.to = _listed([item.to for item in said], rooms.shape[2], 5)
        self.origin = _listed([item.origin for item in said], rooms.shape[2], 5)
        self.nowhere = torch.zeros(len(items), dtype=torch.bool)
        self.told = torch.zeros(len(items), dtype=torch.long)
        self.states = torch.zeros(len(items), 3)
        self.count = torch.zeros(len(items), dtype=torch.long)
        for at, (row, i) in enumerate(items):
            p, item = prepared[row], said[at]
            m = len(p.mentions)
            self.own[at, :m] = torch.from_numpy(p.own[i])
            self.places[at, :m] = torch.from_numpy(p.places[i])
            self.nowhere[at] = not item.to
            self.told[at] = 1 if item.origin else (2 if item.told_origin else 0)
            self.states[at] = torch.tensor([float(s) for s in item.states])
            asked = bool(item.to) or any(item.states)
            self.count[at] = item.number - 1 if asked else -100
        wished = [(row, w) for row, p in enumerate(prepared) for w in p.example.wishes]
        self.wish_rows = torch.tensor([row for row, _ in wished], dtype=torch.long)
        self.wish = torch.tensor([w.wish for _, w in wished], dtype=torch.long)
        self.wish_of = _listed([w.any_of for _, w in wished], rooms.shape[2], 4)
        self.unwished = torch.zeros(size, count, dtype=torch.bool)
        for row, p in enumerate(prepared):
            self.unwished[row, : len(p.mentions)] = p.whole
        for row, w in wished:
            self.unwished[row, [mention for mention, _, _ in w.any_of]] = False


def _listed(choices: Sequence[Collection[tuple[int, ...]]], rooms: int, width: int) -> Tensor:
    """Return choices as rows: whose they are, then their own indices, that of the room counted from the front."""
    rows = [(at, *one[:-1], one[-1] % rooms) for at, found in enumerate(choices) for one in sorted(found)]
    return torch.tensor(rows, dtype=torch.long).reshape(-1, width)


def _log_of_any(logged: Tensor, of: Tensor, count: int) -> Tensor:
    """Return the log-probability that any of its choices is made, (count,); very little of what has none.

    Args:
        logged: log-probability of each choice, (choices,).
        of: whose choice it is, from 0, (choices,).
        count: how many have choices.
    """
    most = torch.full((count,), _NOTHING).scatter_reduce(0, of, logged.detach(), "amax")
    total = torch.zeros(count).index_add(0, of, torch.exp(logged - most[of]))
    return torch.where(total > 0, torch.log(total.clamp(min=1e-30)) + most, most)


def _masked(x: Tensor, mask: Tensor) -> Tensor:
    return x.masked_fill(~mask, _NOTHING)


def loss_of(batch: Batch, pairs: Tensor, heads: Mapping[str, Tensor], whole: Tensor) -> Tensor:
    """Return the summed loss of a batch: minus the log-probability of what is meant, over all ways to say it."""
    rooms = torch.cat([pairs[..., 4], heads["unnamed_room"].flip(-1), heads["room_none"]], -1)  # as `rooms_in`
    log_rooms = torch.log_softmax(_masked(rooms, batch.rooms), -1)
    log_kinds = torch.log_softmax(_masked(heads["kind"], batch.kinds), -1)
    log_wishes = torch.log_softmax(_masked(heads["wish"], batch.wishes), -1)
    loss = nn.functional.binary_cross_entropy_with_logits(whole, batch.whole, reduction="sum")
    if len(batch.item_rows):
        rows = batch.item_rows
        own = batch.own
        share = own.float() / own.sum(1, keepdim=True).clamp(min=1)
        for slot, none, target, nowhere, known in (
            (0, "none", batch.to, batch.nowhere, torch.ones_like(batch.nowhere)),
            (2, "from_none", batch.origin, batch.told == 0, batch.told != 2),
        ):
            logits = torch.logsumexp(_masked(pairs[rows][..., slot : slot + 2], own[:, :, None, None]), 1)
            logits = _masked(logits, batch.places).flatten(1)
            nothing = (heads[none][rows, :, 0] * share).sum(1, keepdim=True)
            logged = torch.log_softmax(torch.cat([logits, nothing], 1), 1)
            of, place, inside, kind, room = target.unbind(1)
            where = logged[of, 2 * place + inside] + log_kinds[rows[of], place, kind] + log_rooms[rows[of], place, room]
            meant = _log_of_any(where, of, len(rows))
            said = torch.where(nowhere, logged[:, -1], meant)
            loss = loss - (said * known).clamp(min=-20).sum() * (1.0 if slot == 0 else 0.3)
        states = _masked(heads["state"][rows], own[:, :, None]).amax(1)
        loss = loss + nn.functional.binary_cross_entropy_with_logits(states, batch.states, reduction="sum")
        counts = (heads["count"][rows] * share[..., None]).sum(1)
        loss = loss + nn.functional.cross_entropy(counts, batch.count, reduction="sum", ignore_index=-100)
    loss = loss - (log_wishes[..., 0] * batch.unwished).sum()
    if len(batch.wish_rows):
        rows = batch.wish_rows
        of, mention, kind, room = batch.wish_of.unbind(1)
        row = rows[of]
        where = log_wishes[row, mention, batch.wish[of]] + log_kinds[row, mention, kind] + log_rooms[row, mention, room]
        loss = loss - _log_of_any(where, of, len(rows)).clamp(min=-20).sum()
    return loss


def joined(a: Example, b: Example) -> Example | None:
    """Return two texts as one, or None if they speak of the same things."""
    names = {m.name for m in a.read.mentions if not m.room}
    if names & {m.name for m in b.read.mentions if not m.room} or len(a.read.tokens) + len(b.read.tokens) > 150:
        return None
    tokens, count = len(a.read.tokens), len(a.read.mentions)
    read = Spotted(
        a.read.tokens + b.read.tokens,
        a.read.mentions + tuple(m._replace(token=m.token + tokens) for m in b.read.mentions),
        a.read.values + b.read.values,
        np.concatenate([a.read.features, b.read.features]), a.read.house,
    )  # fmt: skip

    def moved(choices: frozenset[Choice]) -> frozenset[Choice]:
        return frozenset((m + count, i, k, r + count if r >= 0 else r) for m, i, k, r in choices)

    items = a.items + tuple(
        item._replace(
            group=item.group._replace(mentions=tuple(m + count for m in item.group.mentions)),
            to=moved(item.to), origin=moved(item.origin),
        )
        for item in b.items
    )  # fmt: skip
    wishes = a.wishes + tuple(
        Wish(frozenset((m + count, k, r + count if r >= 0 else r) for m, k, r in w.any_of), w.wish) for w in b.wishes
    )
    return Example(f"{a.id}+{b.id}", read, items, wishes, a.whole and b.whole)


def _one_thing(example: Example, rng: random.Random) -> list[list[int]]:
    """Return the tokens of one thing that something is asked for, if there is one."""
    asked = [item.group for item in example.items if item.to or any(item.states)]
    return [[example.read.mentions[m].token for m in rng.choice(asked).mentions]] if asked else []


def fit(
    people: Sequence[Example], templates: Sequence[Example], encoder: Encoder, pieces: Pieces,
    values: Mapping[str, int], *, epochs: int, seed: int, rate: float, start: Mapping[str, Tensor] | None = None,
    dropout: float = 0.2, unknown: float = 0.05, joins: float = 0.15, hides: float = 0.08, size: int = 32,
    report: Callable[[str], None] | None = None,
) -> Network:  # fmt: skip
    """Return a network fitted to what people say, beside some sentences of templates.

    Args:
        people: examples, all of which are seen in each epoch.
        templates: examples of which a quarter is seen in each epoch.
        encoder: to start from; it is changed.
        pieces: its vocabulary.
        values: numbers of what tokens of closed classes do.
        epochs: how often people's examples are seen.
        seed: of the order, of what is joined and left out, and of the heads.
        rate: highest learning rate of the encoder.
        start: weights of an earlier run to go on from.
        dropout: share of states that are left out.
        unknown: share of word pieces that are left out.
        joins: how many pairs of people's texts are read as one, against their number.
        hides: in how many of them a thing is taken for an unknown word.
        size: texts of a batch.
        report: told the loss of each epoch.
    """
    torch.manual_seed(seed)
    rng = random.Random(seed)
    network = Network(encoder, len(values) + 1, dropout)
    if start is not None:
        network.load_state_dict(dict(start))
    count = int(len(people) * (1 + joins)) + len(templates) // 4
    own, heads = list[Tensor](), list[Tensor]()
    for name, weight in network.named_parameters():
        (own if name.startswith("encoder.") else heads).append(weight)
    rates = [rate, rate * _OF_HEADS]
    optimizer = torch.optim.AdamW([{"params": own}, {"params": heads}], lr=rate, weight_decay=0.01, fused=True)
    steps = epochs * (-(-int(count + len(people) * hides) // size) + 1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rates, total_steps=steps, pct_start=0.1)
    known = {e.id: Prepared(e, pieces, values) for e in (*people, *templates)}
    network.train()
    for epoch in range(epochs):
        chosen = [known[e.id] for e in people]
        chosen += [known[e.id] for e in rng.sample(templates, len(templates) // 4)]
        while len(chosen) < count:
            both = joined(rng.choice(people), rng.choice(people))
            if both is not None:
                chosen.append(Prepared(both, pieces, values))
        for example in rng.sample(people, int(len(people) * hides)):
            chosen += [Prepared(example, pieces, values, hidden) for hidden in _one_thing(example, rng)]
        chosen = [example.unnamed(rng, pieces, values) for example in chosen]
        chosen.sort(key=lambda p: len(p.given.pieces) * rng.uniform(0.8, 1.2))  # of like length: less is padded
        batches = [chosen[start : start + size] for start in range(0, len(chosen), size)]
        rng.shuffle(batches)
        total = 0.0
        for part in batches:
            batch = Batch(part, rng, unknown)
            loss = loss_of(batch, *network(batch)) / len(part)
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimizer.step()
            schedule.step()
            total += float(loss.detach()) * len(part)
        if report is not None:
            report(f"epoch {epoch + 1}: loss {total / len(chosen):.3f}")
    network.eval()
    return network
