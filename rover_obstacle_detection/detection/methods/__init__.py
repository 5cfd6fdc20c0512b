"""The detection methods: each composes the stages."""
