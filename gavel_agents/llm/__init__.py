"""Language models behind one small interface, chosen by a spec string such as `scripted:FILE.jsonl`."""

from gavel_agents.llm.interface import BadPlannerSpec, ChatModel, Completion, Message, Prompt, load_model, model_kinds

__all__ = ["BadPlannerSpec", "ChatModel", "Completion", "Message", "Prompt", "load_model", "model_kinds"]
