"""Linear models: linearisation, frequency responses, stability margins."""
