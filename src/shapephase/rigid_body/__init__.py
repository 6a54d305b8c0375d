"""The free rigid body and its relatives in closed form (Marsden and Ratiu, chapter 15); needs no robot model."""
