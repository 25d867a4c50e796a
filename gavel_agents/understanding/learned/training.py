"""Training of the learned reader, with torch: `python -m gavel_agents.understanding.learned.train`."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.utils.rnn import pack_padded_sequence, pad_packed_sequence

from gavel_agents.understanding.learned.network import OF_MENTION, OF_PAIR, Array, encoded
from gavel_agents.understanding.learned.options import places_for, rooms_of
from gavel_agents.understanding.learned.spotted import FEATURES, PAIR_FEATURES, Spotted, pair_features
from gavel_agents.understanding.learned.targets import Choice, Example, Wish

__all__ = ["Network", "fit", "joined", "tables_of"]

_NOTHING = -1e4
WORDS, VALUES, ENTER, HIDDEN, PAIR = 48, 16, 96, 72, 64


class Network(nn.Module):  # type: ignore[misc]
    """The network of `network.scores`, with gradients."""

    def __init__(self, words: int, values: int, dropout: float) -> None:
        super().__init__()
        self.word = nn.Embedding(words, WORDS, padding_idx=0)
        self.value = nn.Embedding(values, VALUES)
        self.enter = nn.Linear(WORDS + VALUES + FEATURES, ENTER)
        self.gru = nn.GRU(ENTER, HIDDEN, num_layers=2, bidirectional=True, batch_first=True, dropout=dropout)
        self.first = nn.Linear(2 * HIDDEN, PAIR)
        self.second = nn.Linear(2 * HIDDEN, PAIR, bias=False)
        self.beside = nn.Linear(PAIR_FEATURES, PAIR, bias=False)
        self.pair = nn.Linear(PAIR, len(OF_PAIR))
        self.own = nn.Linear(2 * HIDDEN, PAIR)
        self.heads = nn.Linear(PAIR, sum(OF_MENTION.values()))
        self.drop = nn.Dropout(dropout)

    def forward(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the scores of pairs (texts, mentions, mentions, 5), and of mentions by head."""
        said = batch.ids[..., :4]
        present = (said > 0).unsqueeze(-1)
        embedded = (self.word(said) * present).sum(2) / present.sum(2).clamp(min=1)
        x = torch.cat([embedded, self.value(batch.ids[..., 4]), batch.features], -1)
        x = self.drop(torch.relu(self.enter(x)))
        packed = pack_padded_sequence(x, batch.lengths, batch_first=True, enforce_sorted=False)
        x, _ = pad_packed_sequence(self.gru(packed)[0], batch_first=True, total_length=x.shape[1])
        h = self.drop(torch.gather(x, 1, batch.mentions.unsqueeze(-1).expand(-1, -1, x.shape[-1])))
        hidden = torch.relu(self.first(h)[:, :, None] + self.second(h)[:, None] + self.beside(batch.beside))
        heads = self.heads(self.drop(torch.relu(self.own(h)))).split(list(OF_MENTION.values()), -1)
        return self.pair(self.drop(hidden)), dict(zip(OF_MENTION, heads, strict=True))


def tables_of(examples: Sequence[Example], least: int = 2) -> tuple[dict[str, int], dict[str, int]]:
    """Return the numbers of words (0 = none, 1 = unknown) and of what closed-class tokens do."""
    seen = Counter(word for e in examples for said in e.read.words for word in said)
    words = {word: index + 2 for index, word in enumerate(sorted(w for w, n in seen.items() if n >= least))}
    values = {value: index + 1 for index, value in enumerate(sorted({v for e in examples for v in e.read.values if v}))}
    return words, values


class Prepared:
    """An example as arrays."""

    def __init__(self, example: Example, words: Mapping[str, int], values: Mapping[str, int]) -> None:
        read = example.read
        self.example = example
        self.features, self.ids = encoded(read, words, values)
        self.beside = pair_features(read)
        self.mentions = np.array([m.token for m in read.mentions], dtype=np.int64)
        count = len(read.mentions)
        self.own = np.zeros((len(example.items), count), dtype=bool)
        self.places = np.zeros((len(example.items), count, 2), dtype=bool)
        for row, item in enumerate(example.items):
            self.own[row, list(item.group.mentions)] = True
            for place, inside in places_for(read, item.group):
                self.places[row, place, inside] = True
        self.rooms = np.zeros((count, count), dtype=bool)
        for index, mention in enumerate(read.mentions):
            if not mention.room and not mention.movable:
                self.rooms[index, list(rooms_of(read))] = True
        self.cabinet = np.array([m.cabinet for m in read.mentions], dtype=bool)
        self.thing = np.array([not m.room for m in read.mentions], dtype=bool)


class Batch:
    """Several examples, padded."""

    def __init__(self, prepared: Sequence[Prepared], rng: random.Random | None, unknown: float) -> None:
        length = max(len(p.ids) for p in prepared)
        count = max(*(len(p.mentions) for p in prepared), 1)
        size = len(prepared)
        features = np.zeros((size, length, FEATURES), dtype=np.float32)
        ids = np.zeros((size, length, 5), dtype=np.int64)
        mentions = np.zeros((size, count), dtype=np.int64)
        beside = np.zeros((size, count, count, PAIR_FEATURES), dtype=np.float32)
        rooms = np.zeros((size, count, count + 1), dtype=bool)
        kinds = np.zeros((size, count, 4), dtype=bool)
        rooms[:, :, -1] = True
        kinds[:, :, 0] = True
        for row, p in enumerate(prepared):
            n, m = len(p.ids), len(p.mentions)
            features[row, :n], ids[row, :n], mentions[row, :m] = p.features, p.ids, p.mentions
            beside[row, :m, :m] = p.beside
            rooms[row, :m, :m] = p.rooms
            kinds[row, :m][p.cabinet] = True
        if rng is not None:
            noise = np.random.default_rng(rng.randrange(2**32))
            ids[..., :4][(noise.random(ids[..., :4].shape) < unknown) & (ids[..., :4] > 0)] = 1
        self.features, self.ids, self.mentions = map(torch.from_numpy, (features, ids, mentions))
        self.beside, self.rooms, self.kinds = map(torch.from_numpy, (beside, rooms, kinds))
        self.lengths = [len(p.ids) for p in prepared]
        items = [(row, i) for row, p in enumerate(prepared) for i in range(len(p.example.items))]
        self.item_rows = torch.tensor([row for row, _ in items], dtype=torch.long)
        self.own = torch.zeros(len(items), count, dtype=torch.bool)
        self.places = torch.zeros(len(items), count, 2, dtype=torch.bool)
        self.to = torch.zeros(len(items), count, 2, 4, count + 1, dtype=torch.bool)
        self.origin = torch.zeros_like(self.to)
        self.nowhere = torch.zeros(len(items), dtype=torch.bool)
        self.told = torch.zeros(len(items), dtype=torch.long)
        self.states = torch.zeros(len(items), 3)
        self.count = torch.zeros(len(items), dtype=torch.long)
        for at, (row, i) in enumerate(items):
            p = prepared[row]
            item = p.example.items[i]
            m = len(p.mentions)
            self.own[at, :m] = torch.from_numpy(p.own[i])
            self.places[at, :m] = torch.from_numpy(p.places[i])
            _mark(self.to[at], item.to)
            _mark(self.origin[at], item.origin)
            self.nowhere[at] = not item.to
            self.told[at] = 1 if item.origin else (2 if item.told_origin else 0)
            self.states[at] = torch.tensor([float(s) for s in item.states])
            asked = bool(item.to) or any(item.states)
            self.count[at] = item.number - 1 if asked else -100
        wishes = [(row, w) for row, p in enumerate(prepared) for w in p.example.wishes]
        self.wish_rows = torch.tensor([row for row, _ in wishes], dtype=torch.long)
        self.wish = torch.tensor([w.wish for _, w in wishes], dtype=torch.long)
        self.wish_of = torch.zeros(len(wishes), count, 4, count + 1, dtype=torch.bool)
        self.unwished = torch.zeros(size, count, dtype=torch.bool)
        for row, p in enumerate(prepared):
            self.unwished[row, : len(p.thing)] = torch.from_numpy(p.thing)
        for at, (row, w) in enumerate(wishes):
            for mention, kind, room in w.any_of:
                self.wish_of[at, mention, kind, room] = True
                self.unwished[row, mention] = False


def _mark(table: Tensor, choices: frozenset[Choice]) -> None:
    for mention, inside, kind, room in choices:
        table[mention, inside, kind, room] = True


def _masked(x: Tensor, mask: Tensor) -> Tensor:
    return x.masked_fill(~mask, _NOTHING)


def loss_of(batch: Batch, pairs: Tensor, heads: Mapping[str, Tensor]) -> Tensor:
    """Return the summed loss of a batch: minus the log-probability of what is meant, over all ways to say it."""
    rooms = torch.cat([pairs[..., 4], heads["room_none"]], -1)
    log_rooms = torch.log_softmax(_masked(rooms, batch.rooms), -1)
    log_kinds = torch.log_softmax(_masked(heads["kind"], batch.kinds), -1)
    log_wishes = torch.log_softmax(heads["wish"], -1)
    loss = pairs.new_zeros(())
    if len(batch.item_rows):
        rows = batch.item_rows
        own = batch.own
        share = own.float() / own.sum(1, keepdim=True).clamp(min=1)
        kinds_rooms = log_kinds[rows][:, :, None, :, None] + log_rooms[rows][:, :, None, None, :]
        for slot, none, target, nowhere, known in (
            (0, "none", batch.to, batch.nowhere, torch.ones_like(batch.nowhere)),
            (2, "from_none", batch.origin, batch.told == 0, batch.told != 2),
        ):
            logits = torch.logsumexp(_masked(pairs[rows][..., slot : slot + 2], own[:, :, None, None]), 1)
            logits = _masked(logits, batch.places).flatten(1)
            nothing = (heads[none][rows, :, 0] * share).sum(1, keepdim=True)
            logged = torch.log_softmax(torch.cat([logits, nothing], 1), 1)
            where = logged[:, :-1].view(len(rows), -1, 2)[..., None, None] + kinds_rooms
            meant = torch.logsumexp(_masked(where, target).flatten(1), 1)
            said = torch.where(nowhere, logged[:, -1], meant)
            loss = loss - (said * known).clamp(min=-20).sum() * (1.0 if slot == 0 else 0.3)
        states = _masked(heads["state"][rows], own[:, :, None]).amax(1)
        loss = loss + nn.functional.binary_cross_entropy_with_logits(states, batch.states, reduction="sum")
        counts = (heads["count"][rows] * share[..., None]).sum(1)
        loss = loss + nn.functional.cross_entropy(counts, batch.count, reduction="sum", ignore_index=-100)
    loss = loss - (log_wishes[..., 0] * batch.unwished).sum()
    if len(batch.wish_rows):
        rows = batch.wish_rows
        wished = log_wishes[rows].gather(2, batch.wish[:, None, None].expand(-1, log_wishes.shape[1], 1))
        where = wished[..., None] + log_kinds[rows][..., None] + log_rooms[rows][:, :, None, :]
        loss = loss - torch.logsumexp(_masked(where, batch.wish_of).flatten(1), 1).clamp(min=-20).sum()
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
        a.read.words + b.read.words, a.read.values + b.read.values,
        np.concatenate([a.read.features, b.read.features]), a.read.house,
    )  # fmt: skip

    def moved(choices: frozenset[Choice]) -> frozenset[Choice]:
        return frozenset((m + count, i, k, r + count if r >= 0 else -1) for m, i, k, r in choices)

    items = a.items + tuple(
        item._replace(
            group=item.group._replace(mentions=tuple(m + count for m in item.group.mentions)),
            to=moved(item.to), origin=moved(item.origin),
        )
        for item in b.items
    )  # fmt: skip
    wishes = a.wishes + tuple(
        Wish(frozenset((m + count, k, r + count if r >= 0 else -1) for m, k, r in w.any_of), w.wish) for w in b.wishes
    )
    return Example(f"{a.id}+{b.id}", read, items, wishes, a.whole and b.whole)


def fit(
    people: Sequence[Example], templates: Sequence[Example], words: Mapping[str, int], values: Mapping[str, int],
    *, epochs: int, seed: int, dropout: float = 0.3, unknown: float = 0.15, per_epoch: int = 200, joins: float = 0.3,
    report: Callable[[str], None] | None = None,
) -> dict[str, Array]:  # fmt: skip
    """Return the weights of a network fitted to what people say, beside some sentences of templates."""
    torch.manual_seed(seed)
    rng = random.Random(seed)
    network = Network(len(words) + 2, len(values) + 1, dropout)
    steps_per_epoch = (int(len(people) * (1 + joins)) + per_epoch + 31) // 32
    optimizer = torch.optim.AdamW(network.parameters(), lr=3e-3, weight_decay=0.01)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 4e-3, total_steps=epochs * (steps_per_epoch + 2))
    known = {e.id: Prepared(e, words, values) for e in (*people, *templates)}
    network.train()
    for epoch in range(epochs):
        chosen = [known[e.id] for e in people]
        chosen += [known[e.id] for e in rng.sample(templates, min(per_epoch, len(templates)))]
        while len(chosen) < int(len(people) * (1 + joins)) + per_epoch:
            both = joined(rng.choice(people), rng.choice(people))
            if both is not None:
                chosen.append(Prepared(both, words, values))
        chosen.sort(key=lambda p: len(p.ids) * rng.uniform(0.8, 1.2))  # of like length: less is padded
        batches = [chosen[start : start + 32] for start in range(0, len(chosen), 32)]
        rng.shuffle(batches)
        total = 0.0
        for part in batches:
            batch = Batch(part, rng, unknown)
            pairs, heads = network(batch)
            loss = loss_of(batch, pairs, heads) / len(part)
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 2.0)
            optimizer.step()
            schedule.step()
            total += float(loss.detach()) * len(part)
        if report is not None:
            report(f"epoch {epoch + 1}: loss {total / len(chosen):.3f}")
    return {name: value.detach().numpy().astype(np.float32) for name, value in network.state_dict().items()}
