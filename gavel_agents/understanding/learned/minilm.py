"""The encoder that training starts from: the lowest layers of MiniLM, with the commonest of its word pieces."""

from __future__ import annotations

import string
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from transformers import AutoModel, AutoTokenizer

from gavel_agents.understanding.learned.encoder import LONGEST, Array
from gavel_agents.understanding.learned.pieces import SIGNS, Pieces
from gavel_env.errors import DataError

__all__ = ["Encoder", "load_encoder"]

_PLAIN = frozenset(string.ascii_lowercase + string.digits + string.punctuation + "’“”–—…→•£€")


class Encoder(nn.Module):  # type: ignore[misc]
    """A transformer whose tokens are told more than their words; `encoder.encode` computes the same in numpy."""

    def __init__(self, bert: nn.Module) -> None:
        super().__init__()
        self.bert = bert
        self.width = int(bert.config.hidden_size)

    def forward(self, pieces: Tensor, present: Tensor, starts: Tensor, told: Tensor) -> Tensor:
        """Return the states of word pieces, (texts, pieces, width).

        Args:
            pieces: numbers of word pieces, (texts, pieces).
            present: 1 for each that is there, (texts, pieces).
            starts: place of each token's first piece, (texts, tokens).
            told: what is added there, (texts, tokens, width); 0 beyond the end.
        """
        x = self.bert.embeddings.word_embeddings(pieces)
        x = x.scatter_add(1, starts.unsqueeze(-1).expand(-1, -1, x.shape[-1]), told)
        return self.bert(inputs_embeds=x, attention_mask=present).last_hidden_state

    def tensors(self) -> dict[str, Array]:
        """Return the weights as `encoder.encode` takes them; those of layers begin with `layer.N.`."""
        found: dict[str, Tensor] = {}
        embeddings = self.bert.embeddings
        found["word"] = embeddings.word_embeddings.weight
        found["position"] = embeddings.position_embeddings.weight[:LONGEST] + embeddings.token_type_embeddings.weight[0]
        parts = {"entered": embeddings.LayerNorm}
        for number, layer in enumerate(self.bert.encoder.layer):
            attention = layer.attention
            parts |= {
                f"layer.{number}.{name}": part
                for name, part in (
                    ("query", attention.self.query), ("key", attention.self.key), ("value", attention.self.value),
                    ("out", attention.output.dense), ("out.normal", attention.output.LayerNorm),
                    ("up", layer.intermediate.dense), ("down", layer.output.dense),
                    ("down.normal", layer.output.LayerNorm),
                )
            }  # fmt: skip
        for name, part in parts.items():
            if isinstance(part, nn.LayerNorm):
                found[f"{name}.weight"] = part.weight
            else:
                found[name] = part.weight.T
            found[f"{name}.bias"] = part.bias
        return {name: np.ascontiguousarray(t.detach().numpy(), dtype=np.float32) for name, t in found.items()}


def load_encoder(folder: Path | str, layers: int, words: int) -> tuple[Encoder, Pieces]:
    """Return the lowest layers of a BERT-like model of a folder or a hub, and its first word pieces.

    Args:
        folder: of the model and its tokenizer, or its name.
        layers: how many are kept.
        words: how many word pieces of the vocabulary are looked at, which has the commonest first.

    Raises:
        DataError: it cannot be loaded.
    """
    try:
        tokenizer = AutoTokenizer.from_pretrained(folder)
        bert = AutoModel.from_pretrained(folder, attn_implementation="eager")
    except (OSError, ValueError) as error:
        raise DataError(f"{folder} holds no encoder: {' '.join(str(error).split())[:200]}") from error
    every = sorted(tokenizer.get_vocab().items(), key=lambda one: one[1])
    kept = [*((sign, tokenizer.convert_tokens_to_ids(sign)) for sign in SIGNS)]
    kept += [(p, n) for p, n in every if n < words and not p.startswith("[") and _PLAIN.issuperset(p)]
    kept += [(p, n) for p, n in every if n < words and p == "["]
    old = torch.tensor([n for _, n in kept])
    table = nn.Embedding(len(kept), bert.config.hidden_size, padding_idx=0)
    table.weight.data.copy_(bert.embeddings.word_embeddings.weight.data[old])
    bert.embeddings.word_embeddings = table
    bert.encoder.layer = bert.encoder.layer[:layers]
    bert.pooler = None
    for layer in bert.encoder.layer:
        layer.intermediate.intermediate_act_fn = nn.GELU(approximate="tanh")
    return Encoder(bert), Pieces({piece: number for number, (piece, _) in enumerate(kept)})
