"""Life against temperature: lives censored in any way, their law, its bounds and checks."""
