"""An independent witness: sessions generated here, from motion to counts, and nothing of it taken from the product."""
