"""Many fits: launched, claimed, watched, resumed."""
