"""Linear models: linearisation, frequency responses, poles."""
