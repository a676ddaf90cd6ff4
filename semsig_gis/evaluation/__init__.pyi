# What other packages may import from here: name and module, read by `__init__.py`.

from .compare import changed_successes as changed_successes, common_cases as common_cases, compare_evaluations as compare_evaluations
from .error_field import ENOUGH as ENOUGH, ErrorField as ErrorField, RADII as RADII, guess_error as guess_error
from .evaluate import score_queries as score_queries, scored_tables as scored_tables
from .experiments.run import ExperimentWork as ExperimentWork, Part as Part, open_results as open_results, run_experiment as run_experiment, run_experiments as run_experiments
from .figures import AMBIGUITIES as AMBIGUITIES, LENGTHS as LENGTHS, calibration_bins as calibration_bins, coverage_curve as coverage_curve, district_labels as district_labels, figure_means as figure_means, grouped_means as grouped_means, percentile as percentile, plain_records as plain_records, query_figures as query_figures, range_labels as range_labels
from .file import open_evaluation as open_evaluation, save_evaluation as save_evaluation, settings_from_dict as settings_from_dict, settings_to_dict as settings_to_dict, used_noises as used_noises
from .identifiability.check import ChanceBin as ChanceBin, IdentifiabilityCheck as IdentifiabilityCheck, check_identifiability as check_identifiability
from .identifiability.identify import identify as identify
from .identifiability.lookalikes import check_radius as check_radius, find_lookalikes as find_lookalikes
from .identifiability.result import BANDS as BANDS, ClassGain as ClassGain, Identifiability as Identifiability, identifiability_of as identifiability_of, open_identifiability as open_identifiability, save_identifiability as save_identifiability
from .identifiability.symbol_tables import SymbolColumns as SymbolColumns, symbol_columns as symbol_columns
from .identifiability.trials import draw_trials as draw_trials, leave_class_out as leave_class_out, trial_cells as trial_cells, try_cells as try_cells, try_without_classes as try_without_classes
from .paper import published as published
from .paper.published import DATABASE as DATABASE, OCCURRENCES as OCCURRENCES, READ_OFF as READ_OFF
from .paper.reproduction import BEST as BEST, FIRST_STAGE as FIRST_STAGE, FUSIONS as FUSIONS, LEVELS as LEVELS, MANY as MANY, OURS as OURS, PERCENTS as PERCENTS, READINGS as READINGS, Reproduction as Reproduction, SINGLES as SINGLES, WEIGHTS as WEIGHTS, paper_experiments as paper_experiments, reproduce as reproduce, time_queries as time_queries
from .queries.distortion_text import NAMED_DISTORTIONS as NAMED_DISTORTIONS, QueryDistortion as QueryDistortion, chain_text as chain_text, parse_chain as parse_chain, ready_chain as ready_chain
from .queries.distortions import BlockedSectors as BlockedSectors, ClassScores as ClassScores, CompassBias as CompassBias, DISTORTIONS as DISTORTIONS, Detector as Detector, Distortion as Distortion, FalseClass as FalseClass, FieldOfView as FieldOfView, HiddenBehind as HiddenBehind, MissingClasses as MissingClasses, Obstacles as Obstacles, RoughRanges as RoughRanges, distort as distort, named_distortion as named_distortion
from .queries.draw import Query as Query, QuerySpec as QuerySpec, SeenFrom as SeenFrom, draw_queries as draw_queries
from .queries.true_view import CitySights as CitySights, Sight as Sight
from .result import Evaluation as Evaluation, PlotKind as PlotKind, machine as machine
from .spec import Districts as Districts, ExperimentSpec as ExperimentSpec, open_experiment_spec as open_experiment_spec, parse_experiment as parse_experiment
