"""Other methods behind the same interface, from packages the user installs."""
