# What other packages may import from here: name and module, read by `__init__.py`.

from .answers import Answer as Answer, DistanceMemo as DistanceMemo, Locator as Locator, REGION_SHARE as REGION_SHARE, Ranking as Ranking, Requirement as Requirement
from .distance.method import Method as Method
from .distance.metrics import Distances as Distances, METRICS as METRICS, metric as metric
from .distance.metrics.edit import BLOCK as BLOCK, BitPlanes as BitPlanes, EditWeights as EditWeights
from .distance.scores import score_cells as score_cells
from .distance.search import DistanceLocator as DistanceLocator, Localization as Localization
from .distance.ties import NEAR_METRES as NEAR_METRES, NEAR_PLACES as NEAR_PLACES, THRESHOLDS as THRESHOLDS, best_cells as best_cells, chance_within as chance_within, expected_best as expected_best, expected_recall as expected_recall, rank_range as rank_range, top_candidates as top_candidates
from .likelihood.answer_rule import AnswerRule as AnswerRule, DEFAULT_RULE as DEFAULT_RULE, calibrate as calibrate, open_rule as open_rule, save_rule as save_rule
from .likelihood.association import Association as Association, Detections as Detections, Pairs as Pairs, align_cells as align_cells, associate as associate, associate_pairs as associate_pairs, near_pairs as near_pairs, rerank as rerank
from .likelihood.estimate import PlaceEstimate as PlaceEstimate, cell_estimate as cell_estimate, refined_estimate as refined_estimate
from .likelihood.explain import Explanation as Explanation, UNKNOWN_NAME as UNKNOWN_NAME, VERDICTS as VERDICTS, explain as explain, explain_cell as explain_cell
from .likelihood.incremental import TurnMemo as TurnMemo
from .likelihood.index import CellScores as CellScores, LikelihoodIndex as LikelihoodIndex, TURNS as TURNS, build_index as build_index, index_fingerprint as index_fingerprint
from .likelihood.kernels import promising_cells as promising_cells
from .likelihood.locate import LikelihoodLocator as LikelihoodLocator, Location as Location, locate as locate, locate_route as locate_route
from .likelihood.method import LikelihoodMethod as LikelihoodMethod
from .likelihood.off_centre import views_aside as views_aside
from .likelihood.photo import OMITTED_SHARE as OMITTED_SHARE, PhotoTable as PhotoTable, photo_loglik as photo_loglik
from .likelihood.posterior import KEPT as KEPT, Posterior as Posterior, Refinement as Refinement, open_posterior as open_posterior, posterior as posterior, prior_ratio as prior_ratio, refine as refine
from .likelihood.priors import KnownPosition as KnownPosition, area_prior as area_prior, position_prior as position_prior, raster_prior as raster_prior, weight_prior as weight_prior
from .locator import AnyMethod as AnyMethod, localize as localize, make_locator as make_locator, parse_method as parse_method
from .noise.age import Drift as Drift, aged_noise as aged_noise, check_map_age as check_map_age, fresh_noise as fresh_noise, named_drift as named_drift, open_drift as open_drift
from .noise.fit import ALL as ALL, drawn_rates as drawn_rates, estimated_rates as estimated_rates, expected_counts as expected_counts, gather_evidence as gather_evidence, model_change as model_change, next_model as next_model
from .noise.learn import NoiseEstimate as NoiseEstimate, Sample as Sample, learn_noise as learn_noise, read_samples as read_samples
from .noise.model import NOISES as NOISES, Noise as Noise, NoiseMixture as NoiseMixture, NoiseSpec as NoiseSpec, cell_noise as cell_noise, named_noise as named_noise, noise_from_dict as noise_from_dict, open_noise as open_noise, place_noise as place_noise, save_noise as save_noise
from .noise.table import LONGEST_TABLE as LONGEST_TABLE, NoiseTable as NoiseTable, database_tables as database_tables, mean_table as mean_table, noise_tables as noise_tables, query_bearings as query_bearings
from .regions import SearchRegions as SearchRegions, search_regions as search_regions
from .route import LOST_LEG_CHANCE as LOST_LEG_CHANCE, Leg as Leg, moved_chances as moved_chances, route_posteriors as route_posteriors
from .suggest import next_questions as next_questions, with_unplaced as with_unplaced
