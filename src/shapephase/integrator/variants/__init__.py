"""Many deformations along one path, sampled and stepped side by side: none depends on its companions."""
