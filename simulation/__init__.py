"""PyBullet worlds: clients, URDFs, closed-loop machines. PyBullet itself loads with the modules that use it."""
