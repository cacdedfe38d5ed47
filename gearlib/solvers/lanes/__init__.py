"""Many runs of one scene side by side in the lanes of vector instructions."""
