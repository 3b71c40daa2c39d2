"""Many-light: virtual point lights gathered with rays or imperfect shadow maps (Linke 2016)."""
