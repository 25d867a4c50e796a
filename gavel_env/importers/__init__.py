"""Scene graphs of other projects as graphs of this one: VirtualHome, AI2-THOR and ProcTHOR, ConceptGraphs, Hydra.

Every importer takes the path of a JSON file or what it says, and returns an `Imported`: a `gavel-graph/1` file to save,
edit and read with `SceneGraph.from_json`, and which of its names stands for which of theirs.
"""

from gavel_env.importers.ai2thor import from_ai2thor
from gavel_env.importers.building import Imported
from gavel_env.importers.scene_graphs_3d import from_conceptgraphs, from_hydra
from gavel_env.importers.virtualhome import from_virtualhome

__all__ = ["IMPORTERS", "Imported", "from_ai2thor", "from_conceptgraphs", "from_hydra", "from_virtualhome"]

IMPORTERS = {
    "virtualhome": from_virtualhome,
    "ai2thor": from_ai2thor,
    "procthor": from_ai2thor,
    "conceptgraphs": from_conceptgraphs,
    "hydra": from_hydra,
}
"""Name of a format -> its importer."""
