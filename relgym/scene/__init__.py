"""What the world is: objects, shapes, scenes, and the relations and contacts between them."""

from relgym.scene.contacts import CONTACT_FEATURES, contact_features
from relgym.scene.context import canonical_order, signature
from relgym.scene.objects import Kinematics, ObjectType, Scene, SceneLayout, SceneObject, Target, Transition
from relgym.scene.relations import TOUCH_EPS, Extractor, Relations, unary
from relgym.scene.schema import SceneSchema
from relgym.scene.shapes import Box, Compound, ConvexPolyhedron, Prism, Shape, Sphere, Wedge
from relgym.scene.state import RelationalState, relational_state

__all__ = [
    "CONTACT_FEATURES",
    "TOUCH_EPS",
    "Box",
    "Compound",
    "ConvexPolyhedron",
    "Extractor",
    "Kinematics",
    "ObjectType",
    "Prism",
    "RelationalState",
    "Relations",
    "Scene",
    "SceneLayout",
    "SceneObject",
    "SceneSchema",
    "Shape",
    "Sphere",
    "Target",
    "Transition",
    "Wedge",
    "canonical_order",
    "contact_features",
    "relational_state",
    "signature",
    "unary",
]
