"""Integration methods: each takes a problem of numbers and native functions."""
