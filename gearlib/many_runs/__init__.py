"""Many runs or analyses of one model: variation, execution, and collected results."""
