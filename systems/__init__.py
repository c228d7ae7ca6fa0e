"""The Drake systems, the scenario schema and the diagram builder."""
