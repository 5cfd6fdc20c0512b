"""The detection methods: each composes the stages and decides what is free."""
