"""The contract: what every artifact, configuration file and JSON document holds. pydantic and stdlib only."""
