"""The last part of each command's help: examples, file formats, definitions."""

MAIN_EPILOG = """\
first steps:
  wgpu-gi render scene.glb        a picture in out.png: many-light, automatic exposure
  wgpu-gi view scene.glb          the same in a window
  wgpu-gi COMMAND -h              the options of a command, with examples
"""

RENDER_EPILOG = """\
examples:
  wgpu-gi render                                    the built-in Cornell box to out.png
  wgpu-gi render scene.glb --camera 1 --size 1280x720 --quality high
  wgpu-gi render scene.glb --camera inside          a view at eye height
  wgpu-gi render scene.glb --gi path --spp 256      the truth, by path tracing
  wgpu-gi render scene.glb --gi path --spp 32 --denoise    the same in an eighth of the time, slightly smoothed
  wgpu-gi render scene.glb --gi none                direct light only, the fastest
  wgpu-gi render scene.obj --env sky.hdr --light "sun 0.3,-1,0.2 3,3,2.8"
  wgpu-gi render scene.glb --light "spot 0,3,0 0,-1,0 50 30,20" --transparent
  wgpu-gi render scene.glb --relight 0=5,4,3 --relight "env=1,1,1 90"
  wgpu-gi render scene.glb -o frame.exr --show radiance --show depth --show normal
  wgpu-gi render scene.glb -o f/{frame:04d}.exr --frames 0:240 --turntable --layers depth,normal --shard 1/8
  wgpu-gi render scene.glb -o around.mp4 --frames 0:240 --turntable
  wgpu-gi render scene.glb --time 2s                the best picture within two seconds
  wgpu-gi render scene.glb --error 0.001 --time 1h  until its relMSE is 0.001, for an hour at most
  wgpu-gi render scene.glb --certify                and measure relMSE and bias at 200 random pixels
  wgpu-gi render scene.glb --at 1.5 --animation walk
  wgpu-gi render scene.glb -o walk.mp4 --frames 0:240 --fps 24
  wgpu-gi render --gi ssil --set help               the settings of a technique

output:
  .npy .npz .exr .hdr    linear radiance, W/(m2 sr), without exposure or tone curve; .hdr has 8 bits and an exponent
  .png .jpg .webp .mp4   sRGB, 8 bits, with exposure and tone curve
  --show depth: metres along the pixel's ray, 0 without a surface. --show alpha: share of the pixel that surfaces cover.
  --transparent: the environment lights the scene, but is no background. Alpha is straight in .png and .webp; in .exr,
  .npy and .npz colours are multiplied by it.
  Automatic exposure brings the log-average luminance to 0.18. It is printed and stored in the .png, rounded to
  0.1 EV, so --exposure with that number gives the same picture. A sequence keeps the exposure of its first frame.

cameras:
  --camera takes {"position": [0, 1, 5], "target": [0, 1, 0]}, or a .json file with that. Optional: "up", [0, 1, 0];
  "yfov_deg", the full vertical angle, 60; "orthographic_height", the height of a parallel view in metres.

budgets:
  --time and --error choose technique, quality and number of frames by a short measurement in the scene, which is kept
  for the next run; with --gi, only that technique's. The error is relMSE, its bias included. --error ends with a
  certificate that confirms it. --time counts from the loaded scene to the finished picture; a certificate adds seconds.
  Ctrl-C ends any picture: what is there is saved, with a certificate, which a second Ctrl-C skips. A sequence
  keeps its complete frames.

animations:
  --at T shows the second T of an animation: before its start the first pose, after its end the last. So does --time T
  without a unit, if the scene has an animation or is a USD file. Without a time, a picture shows the scene at rest, and
  --frames plays: frame F shows the second F / fps, from the start again after the end. A camera that the animation
  moves is followed. `wgpu-gi info SCENE` lists the animations.

sequences:
  --frames A:B renders frames A to B-1 and skips those whose files exist, so the same command resumes a stopped run.
  --shard I/N renders part I of N, I-J/N parts I to J; frames do not depend on the split. A .json beside the frames
  holds the command, every camera and its time; a different command is refused. Techniques with a temporal history clear
  it every 32 frames and then render 8 warm-up frames that are not written.
  --camera-path FILE holds a list of keys: [{"frame": 0, "position": [0, 1, 5], "target": [0, 1, 0]}, ...].
"""

VIEW_EPILOG = """\
examples:
  wgpu-gi view scene.glb                            drag to orbit; ? in the window lists all keys
  wgpu-gi view scene.glb --gi none --size 1280x720
  wgpu-gi view scene.obj --env sky.hdr --light "sun 0.3,-1,0.2 3,3,2.8" --exposure 1
  wgpu-gi view scene.glb --fps 30 --error 0.0001    fewer pixels while it moves; refined at rest

It needs a display and pip install glfw imgui-bundle. Shader files are reloaded when saved.
"""

COMPARE_EPILOG = """\
examples:
  wgpu-gi compare frame.exr truth.exr
  wgpu-gi compare a.npz b.npz --layer indirect
  wgpu-gi compare a.npz truth.npz:emit+direct+one+multi --noise truth.npz:se_full
  wgpu-gi compare a.npz b.npz --mask regions.png --html report.html --json report.json

A and B are linear (.npy .npz .exr) and of one size. FILE:LAYER names a layer, FILE:ONE+TWO the sum of several. The
default layer is R, G, B of an .exr and "radiance" of an .npz.

With x of A, t of B, m the mean of t over the picture or the region:
  relMSE              mean((x-t)^2 / (t^2 + 0.01 m^2)), minus the noise floor if --noise is given
  noise floor         the relMSE that the noise of B alone causes
  bias                mean(x-t) / m; in the JSON a fraction, not percent
  99.9th percentile   of |x-t| / (t + 0.1 m), for fireflies
  FLIP                mean LDR-FLIP, from 0 (equal) to 1, at 67 pixels per degree. Both pictures are scaled so that
                      the mean luminance of B is 0.18, and clipped at 1. Needs pip install flip-evaluator
"""

BENCH_EPILOG = """\
examples:
  wgpu-gi bench scene.glb                           a survey of every technique: a ranking and bench.png
  wgpu-gi bench a.glb b.glb --quality low,medium,high --json now.json --plot now.png
  wgpu-gi bench a.glb --gi many-light --sweep vpl.count=512,2048 --sweep gather.rays=1,4 --plot best.png
  wgpu-gi bench a.glb --moving --sweep temporal.frames=1,8      flicker, lag and ghosts
  wgpu-gi bench walk --moving --gi many-light,ssdo  errors while its animation plays
  wgpu-gi bench a.glb --compare before.json         ratios of time and error to an earlier run on this machine
  wgpu-gi bench a.glb --truth truth.npz             layers as `render` names them, or emit, direct, one, multi

A survey takes about a minute on a CPU: low and medium quality at 160x90, whole pictures against all light. It ranks
them: best within 100 ms and 1 s; trade-off: nothing else has less error in less time; not worth it, and why.
Any option on what to measure, --size, --json and --compare ask for the full bench instead:

Errors: linear radiance at the pixel centres, over the pixels that see a surface, as `wgpu-gi compare` defines them,
minus the noise of the truth.
Times: medians after a warm-up, in three cases: still (nothing changes), camera moving, all moving (every pass runs).
GPU ms is the sum over the passes of a frame; wall ms includes Python and waiting.
Moving (--moving), against the technique's own converged pictures of the same views:
  flicker             variance over frames of (x-t)/(t+0.1 m) at points in view throughout; the camera walks and turns
  lag                 frames until the mean is 90 % there, and stays, after all light steps to 4 times or a quarter
  ghost               relMSE at points that came into view in the last 4 frames, as the camera or an instance moves
  relMSE, bias        of all pixels while the camera moves
  one sample, anti-aliased: the full picture without and with camera.antialias, against box-filtered pictures
  A scene with an animation, such as walk, plays at 30 frames a second. Pictures of a history of 1, 8 and 24 frames
  (temporal.frames) are compared with path-traced ones of the same poses, at three times: relMSE, bias, and ghosts,
  which are relMSE where a surface that does not deform came into view in the last 8 frames.
Truth: --truth path renders it, which may take minutes, and caches it in ~/.cache/wgpu_gi/truth (XDG_CACHE_HOME and
WGPU_GI_CACHE move it). The folder may be deleted at any time.
"""

STRESS_EPILOG = """\
examples:
  wgpu-gi stress --minutes 10 -o report             every technique, seeds from 0, as far as ten minutes reach
  wgpu-gi stress --kinds room,glossy --seeds 0:50 --gi many-light,ssil --json now.json
  wgpu-gi stress --checks truth --seeds 100:130     errors against the path tracer on 330 scenes
  wgpu-gi stress --checks help                      the checks, a sentence each
  wgpu-gi stress --scene report/room-7-ssil-cut.glb --gi ssil --checks cut --seeds 7:8

Kinds: room, street, foliage, glossy, textured, many, tiny, huge, far, degenerate, extreme, moving, layered, glass.
Each scene and technique is checked for bad values and for repetition, then for one relation in its turn; comparisons
with the path tracer, white furnaces, new renderers and leaks come every few seeds. A relation promises equal bits, or
equal means: these are tested over blocks with several seeds, and a suspicion is confirmed with 24, then 96 new seeds.
A failing scene is reduced while it fails in the same way, and saved as .glb with the command that shows it again.
The exit code is 0 without failures, 1 with failures, 2 for bad arguments.
"""

REPORT_EPILOG = """\
examples:
  wgpu-gi report                                    report.json and report.html, in at most seven minutes
  wgpu-gi report --sponza sponza.glb -o here        the same with Crytek's Sponza
  wgpu-gi report --against other.json               beside another adapter's report
  wgpu-gi report a.json b.json c.json -o all        three reports in one page; measures nothing
  wgpu-gi report a.json --markdown                  the tables as Markdown

What it holds: driver, features and limits; a self-test of shaders and light against closed forms; errors against stored
truths; whether timestamps are right; rays per second; the time to build a hierarchy; the main thread's time per frame;
the time of every pass of every technique at 1920x1080; memory. In a source checkout with pytest, also the shader tests.
The exit code is 0, 1 if a check of the self-test failed, 2 for bad arguments.
"""

INFO_EPILOG = """\
examples:
  wgpu-gi info                                      what this machine offers
  wgpu-gi info scene.glb                            triangles, size, lights, cameras, animations and their duration

The exit code is 0 if an adapter can be used, and for a scene that loads, else 2.
"""

FARM_EPILOG = """\
examples:
  wgpu-gi farm render scene.glb -o out/{frame:04d}.exr --frames 0:2400 --turntable
  wgpu-gi farm template --for slurm --to job.sh scene.glb -o out/{frame:04d}.exr --frames 0:2400 --turntable
"""

FARM_RENDER_EPILOG = """\
examples:
  wgpu-gi farm render scene.glb -o f/{frame:04d}.exr --frames 0:2400 --turntable
  wgpu-gi farm render scene.glb -o /shared/f/{frame:04d}.exr --frames 0:2400 --scheduler tcp://host:8786
  wgpu-gi farm render scene.glb -o f/{frame:04d}.exr --frames 0:2400 --scheduler tcp://host:8786 --gather
  wgpu-gi farm render scene.glb -o large.exr --size 8192x8192 --gi path --farm-tiles

It needs pip install distributed (Dask). Start `dask scheduler` on one machine, and on the others `dask worker
tcp://HOST:8786 --nthreads 1`; where a CPU renders, set LP_NUM_THREADS=1 and add --nworkers with the number of cores. A
machine with several GPUs takes a worker for each, with WGPU_GI_ADAPTER=0, 1 ... All have the same wgpu_gi and scene.

Pictures are those of `wgpu-gi render --frames` on one machine, bit for bit, and so is the .json: both commands resume
and share one another's frames. Frames of a worker that ends go to another. The same command again renders what is
missing at the end. --farm-tiles renders the tiles of one picture; they are sent here and, until it is written, kept in
the folder OUTPUT.tiles. The exit code is 0, 1 if frames or tiles are missing, 2 if nothing could be rendered.
"""

TEMPLATE_EPILOG = """\
examples:
  wgpu-gi farm template --for slurm --to job.sh scene.glb -o out/{frame:04d}.exr --frames 0:2400 --turntable
  wgpu-gi farm template --for openjd --to job.json --program /opt/gi/wgpu-gi scene.glb -o {frame}.png --frames 0:99
  wgpu-gi farm template --for opencue --tasks 200 scene.glb -o out/{frame}.exr --frames 0:2400 --gi path

It takes the arguments of `wgpu-gi render`. Each task renders its part of the frames into the same folder, which all
machines must see under the same name, as well as the scene; file names become absolute. Frames that exist are skipped,
so a task, or the whole job, may run again. A task ends with 0 if all its frames are there, with 2 after an error in its
arguments or its scene, which will come again.
  openjd       Open Job Description 2023-09 with task chunks, as JSON: chunks of tasks take about five minutes
  slurm        a script for sbatch: an array of tasks
  opencue      a job specification for Cuebot; the variables SHOW and SHOT give show and shot
"""

DATASET_EPILOG = """\
examples:
  wgpu-gi dataset scenes/dataset.toml -o data       200 frames of two built-in scenes
  wgpu-gi dataset rooms.toml -o data --shard 3/8    one of eight machines that share a folder
  wgpu-gi dataset rooms.toml -o try --set camera.frames=1

CONFIG.toml, beside its files:
  frames = 200                    also seed, size, gi, quality, exposure, settings = ["vpl.count=512"]
  data = ["picture", "depth_z"]   also depth_ray normal albedo instance category direct indirect standard_error flow
                                  occlusion objects amodal
  [[scenes]]                      file, environment, time: each frame shows one of the scenes
  [cameras]                       kind = "sphere", "room" or "path", and its fields; of one scene: [scenes.cameras]
  [lights] [sky] [[objects]]      what varies, and objects that are put on floors
  [motion]                        what moves until the second time: for flow and occlusion
  [categories]                    box = ["*box*"]: patterns of names of nodes
  [writers.folder]                also webdataset, coco, nerf
python -m pydoc wgpu_gi.dataset.config has every field. Ranges are [least, most].

A frame depends on seed and number alone: the same configuration gives the same bytes, in one run or in parts. Frames
that exist are skipped, so the same command finishes a stopped run. Its dataset.json refuses another configuration.
"""
