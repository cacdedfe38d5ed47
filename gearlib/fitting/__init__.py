"""Parameter identification from measured histories, responses, modes and margins."""
