"""Parts that several commands share: options, running a study, choosing policies."""
