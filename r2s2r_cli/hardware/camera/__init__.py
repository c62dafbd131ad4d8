"""RGB-D cameras: one interface (`base.Camera`), and what can stand behind it."""
