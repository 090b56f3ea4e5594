"""Names for swappable components, resolved lazily: listing them imports nothing."""

import difflib
import inspect
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, NamedTuple

from n2n.errors import ConfigError


class Builtin(NamedTuple):
    """Where a component lives and what it is, in one line."""

    path: str
    summary: str


class Registry:
    """Components of one kind.

    Names come from a literal table, from entry points of installed packages, and from `register` (notebooks).

    Args:
        kind: Singular noun for messages, e.g. `distance`.
        group: Entry point group third parties use, e.g. `n2n.distances`.
        builtins: The table.
    """

    def __init__(self, kind: str, group: str, builtins: Mapping[str, Builtin]) -> None:
        self.kind, self.group = kind, group
        self._builtins = dict(builtins)
        self._registered: dict[str, Callable[..., Any]] = {}

    def names(self) -> list[str]:
        """Return all known names, sorted; imports no component."""
        return sorted({*self._builtins, *self._registered, *self._plugins()})

    def plugin_names(self) -> list[str]:
        """Return the names that installed third-party packages add."""
        return sorted(set(self._plugins()) - set(self._builtins))

    def describe(self, name: str) -> str:
        """Return one line about a component; imports only what third parties registered."""
        if name in self._builtins and name not in self._registered:
            return self._builtins[name].summary
        try:
            component = self.get(name)
        except ConfigError as error:
            return f"broken: {error}"
        document = (inspect.getdoc(component) or "no description").splitlines()[0]
        plugin = None if name in self._registered else self._plugins().get(name)
        return f"{document} [{plugin.dist.name}]" if plugin and plugin.dist else document

    def get(self, name: str) -> Callable[..., Any]:
        """Import and return the class or function called `name`.

        Raises:
            ConfigError: Unknown name (with the nearest known one), or a plugin that cannot be imported.
        """
        if name in self._registered:
            return self._registered[name]
        if name in self._builtins:
            module, _, attribute = self._builtins[name].path.partition(":")
            return getattr(import_module(module), attribute)
        plugin = self._plugins().get(name)
        if plugin is None:
            raise ConfigError(f"Unknown {self.kind} {name!r}.{suggest(name, self.names())}")
        try:
            return plugin.load()
        except Exception as error:
            package = plugin.dist.name if plugin.dist else plugin.value
            raise ConfigError(
                f"the {self.kind} {name!r} of plugin {package!r} cannot be imported ({error}); reinstall or remove it"
            ) from error

    def build(self, spec: str | Mapping[str, Any], **extra: Any) -> Any:
        """Construct a component from `name` plus keyword arguments.

        Args:
            spec: A name, or a mapping with `name` and the component's arguments.
            extra: Defaults the caller provides; used where the component accepts them and the spec is silent.

        Raises:
            ConfigError: Unknown name, unknown argument or missing argument, found before anything is constructed.
        """
        component, arguments = self._bind(spec, extra)
        return component(**arguments)

    def check(self, spec: str | Mapping[str, Any], *given: str) -> None:
        """Raise what `build` would raise about names and arguments, without constructing anything.

        Args:
            spec: As for `build`.
            given: Names of the arguments the caller will provide as `extra`.
        """
        self._bind(spec, dict.fromkeys(given))

    def _bind(
        self, spec: str | Mapping[str, Any], extra: Mapping[str, Any]
    ) -> tuple[Callable[..., Any], dict[str, Any]]:
        arguments = {"name": spec} if isinstance(spec, str) else dict(spec)
        name = arguments.pop("name", None)
        if not isinstance(name, str):
            raise ConfigError(f"a {self.kind} needs a name. Known: {', '.join(self.names())}.")
        component = self.get(name)
        parameters = inspect.signature(component).parameters
        open_ended = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
        known = [p.name for p in parameters.values() if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
        for argument in arguments:
            if argument not in known and not open_ended:
                expected = suggest(argument, [k for k in known if k not in extra])
                raise ConfigError(f"{self.kind} {name!r} has no argument {argument!r}.{expected or ' It takes none.'}")
        for argument, value in extra.items():
            if argument in known or open_ended:
                arguments.setdefault(argument, value)
        missing = [k for k in known if parameters[k].default is inspect.Parameter.empty and k not in arguments]
        if missing:
            raise ConfigError(
                f"{self.kind} {name!r} needs {', '.join(missing)}; give it as {self.kind}.{missing[0]}=..."
            )
        return component, arguments

    def register(self, name: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        """Return a decorator that adds a class under `name` for this process."""

        def add(component: Callable[..., Any]) -> Callable[..., Any]:
            self._registered[name] = component
            return component

        return add

    def _plugins(self) -> dict[str, EntryPoint]:
        return {point.name: point for point in entry_points(group=self.group)}


def suggest(name: str, known: list[str]) -> str:
    """Return " Did you mean 'x'? Known: ..." for messages; empty without known names."""
    if not known:
        return ""
    close = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {close[0]!r}?" if close else ""
    return f"{hint} Known: {', '.join(sorted(known))}."


ARCHITECTURES = Registry(
    "architecture",
    "n2n.architectures",
    {
        "grid": Builtin("n2n.architectures.grid:Grid", "multi-resolution B-spline grid, closed-form gradient (fast)"),
        "mlp": Builtin("n2n.architectures.mlp:MLP", "the paper's fully connected network, tanh output (App. A)"),
        "siren": Builtin("n2n.architectures.siren:Siren", "fully connected network with sine activations"),
    },
)
DISTANCES = Registry(
    "distance",
    "n2n.distances",
    {
        "approx": Builtin("n2n.losses.distances:Approximate", "the released code's soft multi-scale matching"),
        "cd": Builtin("n2n.losses.distances:Chamfer", "Chamfer distance, the ablation: not one-to-one"),
        "emd": Builtin("n2n.losses.distances:EMD", "earth mover's distance, exact one-to-one matching (Eq. 4)"),
        "sinkhorn": Builtin("n2n.losses.distances:Sinkhorn", "entropic earth mover's distance"),
    },
)
REGULARISERS = Registry(
    "regulariser",
    "n2n.regularisers",
    {
        "consistency": Builtin("n2n.losses.regularisers:Consistency", "geometric consistency (Eq. 6)"),
        "consistency_target": Builtin("n2n.losses.regularisers:ConsistencyTarget", "the released code's variant of R"),
        "eikonal": Builtin("n2n.losses.regularisers:Eikonal", "(||grad f|| - 1)^2"),
        "far_field": Builtin("n2n.losses.priors:FarField", "signed distance to the denoised cloud, off the surface"),
        "none": Builtin("n2n.losses.regularisers:NoRegulariser", "no regulariser"),
        "on_surface": Builtin("n2n.losses.regularisers:OnSurface", "f^2 at the noisy targets"),
        "scaffold": Builtin("n2n.losses.priors:ScaffoldFit", "start from an oriented local fit"),
        "smoothness": Builtin("n2n.losses.regularisers:Smoothness", "thin-plate energy around the surface"),
        "zero_level": Builtin("n2n.losses.regularisers:ZeroLevel", "|f| at the pulled points"),
    },
)
PAIRINGS = Registry(
    "pairing",
    "n2n.pairings",
    {
        "global": Builtin("n2n.transport.pairing:GlobalPairing", "the paper's random batches"),
        "stratified": Builtin("n2n.transport.pairing:StratifiedPairing", "balanced median cuts into small leaves"),
    },
)
DATAMODULES = Registry(
    "datamodule",
    "n2n.datamodules",
    {
        "files": Builtin("n2n.datamodules.files:FilesDataModule", "your own files: observations of one or more shapes"),
        "abc": Builtin("n2n.datamodules.points2surf:ABCDataModule", "ABC of Points2Surf: simulated range scans"),
        "dfaust": Builtin("n2n.datamodules.dfaust:DFaustDataModule", "D-FAUST human scans, the selection of SAP"),
        "famous": Builtin("n2n.datamodules.points2surf:FamousDataModule", "FAMOUS of Points2Surf: simulated scans"),
        "generated": Builtin("n2n.datamodules.generated:GeneratedDataModule", "noisy scans of analytic shapes"),
        "kitti": Builtin("n2n.datamodules.kitti:KittiDataModule", "KITTI: frames of a rotating laser scanner"),
        "paris": Builtin("n2n.datamodules.paris:ParisDataModule", "Paris-rue-Madame: a street in chunks"),
        "pc": Builtin("n2n.datamodules.pointcleannet:PCDataModule", "the PointCleanNet test shapes, noise added"),
        "pu": Builtin("n2n.datamodules.punet:PUDataModule", "the PU-Net test shapes, Poisson-disk clouds, noise added"),
        "scene3d": Builtin("n2n.datamodules.scene3d:Scene3DDataModule", "3D Scene: indoor scans of Zhou and Koltun"),
        "shapenet": Builtin(
            "n2n.datamodules.shapenet:ShapeNetDataModule", "ShapeNet in the layout of Occupancy Networks"
        ),
        "srb": Builtin("n2n.datamodules.srb:SRBDataModule", "Surface Reconstruction Benchmark: simulated range scans"),
    },
)
METRICS = Registry(
    "metric",
    "n2n.metrics",
    {
        "emd": Builtin("n2n.metrics.modules:EMD", "mean distance of an optimal one-to-one matching"),
        "fscore": Builtin("n2n.metrics.modules:FScore", "harmonic mean of precision and recall within a distance"),
        "hausdorff": Builtin("n2n.metrics.modules:Hausdorff", "largest distance to the nearest point, both directions"),
        "l1cd": Builtin("n2n.metrics.modules:L1Chamfer", "mean of both directions' mean distances"),
        "l2cd": Builtin("n2n.metrics.modules:L2Chamfer", "mean of both directions' mean squared distances"),
        "nc": Builtin("n2n.metrics.modules:NormalConsistency", "agreement of normals at nearest points"),
        "p2m": Builtin("n2n.metrics.modules:PointToMesh", "mean squared distances points to mesh plus faces to points"),
        "sdf_error": Builtin("n2n.metrics.modules:SDFError", "error of a signed distance: size and sign"),
    },
)
PROTOCOLS = Registry(
    "protocol",
    "n2n.protocols",
    {
        "neuralpull": Builtin("n2n.evaluation.protocol:Protocol", "ABC, FAMOUS: NeuralPull's halved squared distances"),
        "onet": Builtin("n2n.evaluation.protocol:Protocol", "ShapeNet: 100,000 samples in the unit cube, as ConvONet"),
        "p2s": Builtin("n2n.evaluation.protocol:Protocol", "ABC, FAMOUS: Points2Surf's sum of distances, even samples"),
        "sap": Builtin("n2n.evaluation.protocol:Protocol", "D-FAUST, SRB: 50,000 samples, as Shape As Points"),
        "sbp": Builtin("n2n.evaluation.protocol:Protocol", "PU, PC: denoised or upsampled points, as score-denoise"),
        "scene3d": Builtin("n2n.evaluation.protocol:Protocol", "3D Scene: 1,000,000 samples in metres, as CAP-UDF"),
    },
)
BASELINES = Registry(
    "baseline",
    "n2n.baselines",
    {
        "bilateral": Builtin("n2n.baselines.cgal:Bilateral", "bilateral smoothing of CGAL (pip install n2n[cgal])"),
        "jet": Builtin("n2n.baselines.cgal:Jet", "jet smoothing of CGAL (pip install n2n[cgal])"),
        "poisson": Builtin("n2n.baselines.poisson:ScreenedPoisson", "screened Poisson (pip install n2n[poisson])"),
    },
)
ALL = [ARCHITECTURES, DISTANCES, PAIRINGS, REGULARISERS, DATAMODULES, METRICS, PROTOCOLS, BASELINES]
