"""Durable jobs: their workflows, the workers, and recovery when a worker dies."""
