"""Many sessions of one unit: variances between sessions, changes among them, and dependence on temperature."""
