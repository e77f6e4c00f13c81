"""Many sessions of one unit: variances between them, changes among them, and how they follow temperature."""
