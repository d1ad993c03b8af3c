"""Jobs that survive: durable workflows, who works on them, and what happens when a worker dies."""
