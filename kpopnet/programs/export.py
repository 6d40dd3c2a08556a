"""Writes a network as an ONNX file, for other programs and languages, and for prediction without torch.

    kpopnet export pose.onnx                                          the network that comes with the package
    kpopnet export pose.onnx --checkpoint outputs/train/RUN/best

The file takes (N, C, S, S) float32 crops and gives (N, 15, 3) joints in cube units and (N, 15) confidence, for any N
(kpopnet/data/cube.py has the crop and the units). Its metadata holds the model's settings, those of the ridge image, and the
names of the joints. It is checked and run once; the largest difference to torch is printed. `NetworkEstimator("pose.onnx")`,
`PoseEstimator.load("pose.onnx")` and `python evaluate.py checkpoint=pose.onnx` run it with ONNX Runtime.
"""

from pathlib import Path

from kpopnet.networks.checkpoint import load_network
from kpopnet.networks.onnx_export import export_network
from kpopnet.programs.arguments import program_parser
from kpopnet.runtime.endings import user_errors
from kpopnet.weights import shipped


@user_errors
def main() -> None:
    parser = program_parser("kpopnet export", __doc__)
    parser.add_argument("file", type=Path, help="the ONNX file to write; an older one is replaced")
    parser.add_argument("--checkpoint", type=Path, help="folder of a trained network; the one of the package by default")
    given = parser.parse_args()
    network, meta = load_network(given.checkpoint or shipped("joints")[0].parent)
    difference = export_network(network, meta, given.file)
    print(f"{given.file}: {given.file.stat().st_size:,} bytes; differs from torch by {difference:.1e} at most, in cube units")
