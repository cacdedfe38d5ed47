"""Many runs of one model, or many analyses of it: what varies, who carries them out, and what comes back."""
